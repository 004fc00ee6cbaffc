// Seconds that a million pairs take in C++, for bench/python_batch: models in double and in float, on all threads.
//
//   lobefit_batch callisto eon
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "evaluate/float_device.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

constexpr std::size_t pair_count = 1000000, block_size = 2048;
constexpr int repetitions = 15;

struct Pairs {
  std::vector<Direction> wi, wo;

  Pairs() : wi(pair_count), wo(pair_count) {
    const SamplePoints lights(Sampler::philox, {.entry = 0}), views(Sampler::philox, {.entry = 1});
    const auto upper = [](const std::array<double, 2>& u) { return direction(std::acos(u[0]), 2.0 * pi * u[1]); };
    for (std::uint32_t i = 0; i < pair_count; ++i) {
      wi[i] = upper(lights(i));
      wo[i] = upper(views(i));
    }
  }
};

double seconds_in_double(const Model& model, const Pairs& pairs) {
  std::vector<Rgb> values(pair_count);
  const ParameterValues parameters = model.defaults();
  const auto start = std::chrono::steady_clock::now();
  tbb::parallel_for(std::size_t{0}, (pair_count + block_size - 1) / block_size, [&](std::size_t block) {
    const std::size_t first = block * block_size, n = std::min(block_size, pair_count - first);
    model.evaluate_all(parameters.flat(), std::span(pairs.wi).subspan(first, n), std::span(pairs.wo).subspan(first, n),
                       std::span(values).subspan(first, n));
  });
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double seconds_in_float(const Model& model, const FloatPairs& pairs) {
  FloatRgb values(pair_count);
  const ParameterValues defaults = model.defaults();
  const std::vector<float> flat(defaults.flat().begin(), defaults.flat().end());
  return SimdDevice().evaluate(model, {.sets = {flat}, .block_size = block_size}, pairs, values);
}

}  // namespace

}  // namespace lobefit

int main(int argc, char** argv) {
  using namespace lobefit;
  const Pairs pairs;
  FloatPairs float_pairs(pair_count);
  for (std::size_t i = 0; i < pair_count; ++i) float_pairs.set(i, pairs.wi[i], pairs.wo[i]);
  for (int argument = 1; argument < argc; ++argument) {
    const Model& model = find_model(argv[argument]);
    double in_double = 1e9, in_float = 1e9;
    for (int i = 0; i < repetitions; ++i) {
      in_double = std::min(in_double, seconds_in_double(model, pairs));
      in_float = std::min(in_float, seconds_in_float(model, float_pairs));
    }
    fmt::print("{} {} {}\n", model.info->name, in_double, in_float);
  }
}
