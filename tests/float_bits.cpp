// Prints a hash of every model's float batch over random pairs and varied parameters: scripts/instruction_sets runs
// this program with several emulated processors and compares.
#include <cstdint>
#include <cstdio>
#include <cstring>

#include "evaluate/check.h"
#include "evaluate/float_model.h"
#include "reference/sample_points.h"

namespace {

using namespace lobefit;

constexpr std::size_t pair_count = 4096 + 5;  // a remainder for every width

/// Only with operations that IEEE 754 rounds: sines would differ with the processor's libm.
FloatPairs random_pairs() {
  FloatPairs pairs(pair_count);
  for (std::size_t i = 0; i < pair_count; ++i) {
    const auto up = [&](std::uint32_t which) {
      const SamplePoints points(Sampler::philox, {.entry = 2 * i + which});
      const auto first = points(0), second = points(1);
      return normalize(Direction{2.0 * first[0] - 1.0, 2.0 * first[1] - 1.0, second[0] + 1e-3});
    };
    pairs.set(i, up(0), up(1));
  }
  return pairs;
}

std::uint64_t hash(std::uint64_t state, const std::vector<float>& values) {
  for (const float value : values) {  // FNV-1a
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    state = (state ^ bits) * 0x100000001b3u;
  }
  return state;
}

}  // namespace

int main() {
  const FloatPairs pairs = random_pairs();
  FloatRgb values(pair_count);
  for (const Model& model : models()) {
    std::vector<std::string> names;
    for (const ParameterInfo& info : model.parameters) names.emplace_back(info.name);
    std::uint64_t state = 0xcbf29ce484222325u;
    for (const ParameterValues& set : varied_parameters(model.defaults(), names, 16, 1)) {
      const std::vector<float> flat(set.flat().begin(), set.flat().end());
      find_float_model(model.info->name).evaluate(flat, pairs, 0, pair_count, values);
      for (const std::vector<float>* channel : {&values.r, &values.g, &values.b}) state = hash(state, *channel);
    }
    std::printf("%s %016llx\n", std::string(model.info->name).c_str(), static_cast<unsigned long long>(state));
  }
}
