// Models in float over 2^16 pairs of directions: the SIMD batches of evaluate/ against scalar code with libm.
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "bench/benchmarks.h"
#include "bench/instruction_set_model.h"
#include "bench/libm_model.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

constexpr std::size_t pair_count = 1 << 16;

Direction upper_direction(const std::array<double, 2>& u) { return direction(std::acos(u[0]), 2.0 * pi * u[1]); }

FloatPairs random_pairs() {
  const SamplePoints lights(Sampler::philox, {.entry = 0});
  const SamplePoints views(Sampler::philox, {.entry = 1});
  FloatPairs pairs(pair_count);
  for (std::uint32_t i = 0; i < pair_count; ++i) pairs.set(i, upper_direction(lights(i)), upper_direction(views(i)));
  return pairs;
}

struct BatchWork {
  Batch batch;
  std::vector<float> parameters;
};

void register_batches(const std::string& name, const std::string& baseline, std::vector<BatchWork> works) {
  benchmark::RegisterBenchmark(name.c_str(), [baseline, works = std::move(works)](benchmark::State& state) {
    static const FloatPairs pairs = random_pairs();
    FloatRgb values(pair_count);
    for (auto _ : state) {
      for (const BatchWork& work : works) work.batch(work.parameters, pairs, 0, pair_count, values);
      benchmark::ClobberMemory();
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(works.size() * pair_count));
    state.SetLabel(baseline);
  });
}

void register_set(const std::string& set, bool supported, Batch batch) {
  if (!supported) return;
  const ParameterValues defaults = find_model("callisto").defaults();
  register_batches("batch/" + set + "/callisto", "batch/libm/callisto",
                   {{batch, {defaults.flat().begin(), defaults.flat().end()}}});
}

}  // namespace

void register_instruction_sets() {
  register_set("sse2", true, evaluate_callisto_sse2);
  register_set("avx2", __builtin_cpu_supports("avx2"), evaluate_callisto_avx2);
  register_set("avx512f", __builtin_cpu_supports("avx512f"), evaluate_callisto_avx512f);
}

void register_model_batches() {
  std::vector<BatchWork> all_single, all_libm;
  for (std::size_t i = 0; i < models().size(); ++i) {
    const ParameterValues defaults = models()[i].defaults();
    const std::vector<float> parameters(defaults.flat().begin(), defaults.flat().end());
    const BatchWork libm{libm_batches()[i], parameters}, single{float_models()[i].evaluate, parameters};
    const std::string name(models()[i].info->name);
    register_batches("batch/libm/" + name, "", {libm});
    register_batches("batch/single/" + name, "batch/libm/" + name, {single});
    all_libm.push_back(libm);
    all_single.push_back(single);
  }
  register_batches("batch/libm/all_models", "", all_libm);
  register_batches("batch/single/all_models", "batch/libm/all_models", all_single);
}

}  // namespace lobefit
