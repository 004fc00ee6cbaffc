// The microfacet-diffuse reference on one core. A sample is one facet against one light.
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "bench/benchmarks.h"
#include "bench/lanes.h"
#include "bench/peak.h"
#include "reference/diffuse/microfacet_diffuse.h"
#include "reference/references.h"
#include "reference/visible_normals.h"

namespace lobefit {

namespace {

constexpr double alpha = 0.5;
constexpr std::uint32_t facet_count = 2048;  // one replicate of the default number of samples
constexpr std::size_t line_size = 18 * 19;   // lights that share a view in the default grid
const Direction view = direction(radians(50.0), 0.0);

std::shared_ptr<const Integrator> make_surface(std::string_view distribution, std::string_view bounces = "1") {
  ParameterValues values = find_reference(MicrofacetDiffuse::name).defaults();
  values.set("alpha", alpha);
  values.set_text("bounces", bounces);
  values.set_text("distribution", distribution);
  return find_reference(MicrofacetDiffuse::name).make(values);
}

/// A spiral from the normal to 85°.
std::vector<Direction> spread_lights(std::size_t count) {
  std::vector<Direction> lights;
  for (std::size_t i = 0; i < count; ++i) {
    const double along = static_cast<double>(i) / static_cast<double>(count);
    lights.push_back(direction(radians(85.0) * along, 37.0 * 2.0 * pi * along));
  }
  return lights;
}

/// `run` does `count` evaluations.
template <class Run>
void add(const std::string& name, const std::string& baseline, std::size_t count, Run run) {
  benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
    for (auto _ : state) benchmark::DoNotOptimize(run());
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(count));
    state.SetLabel(baseline);
  });
}

void add_facets(const std::string& name, const std::string& baseline, Distribution distribution, Sampler sampler) {
  add(name, baseline, facet_count, [=, points = SamplePoints(sampler, {})] {
    double sum = 0.0;
    for (std::uint32_t k = 0; k < facet_count; ++k) {
      sum += sample_visible_normal(distribution, alpha, view, points(k)).z;
    }
    return sum;
  });
}

enum class Arithmetic { plain_double, vector_float };

/// One set of facets against `light_count` lights.
void add_row(const std::string& name, const std::string& baseline, Arithmetic arithmetic, std::size_t light_count) {
  add(name, baseline, facet_count * light_count,
      [=, surface = make_surface("ggx"), lights = spread_lights(light_count),
       points = SamplePoints(Sampler::sobol, {})] {
        std::vector<Rgb> values(light_count);
        surface->sample_row(view, lights, points, facet_count, arithmetic == Arithmetic::vector_float,
                            {.values = values});
        return values.back().x;
      });
}

/// The same kernel where the unit is floating-point operations: three products, two sums, a comparison and the sum over
/// facets make seven.
void add_row_operations(const std::string& name, std::size_t light_count) {
  add(name, "peak/multiply_add_operations", 7 * facet_count * light_count,
      [=, surface = make_surface("ggx"), lights = spread_lights(light_count),
       points = SamplePoints(Sampler::sobol, {})] {
        std::vector<Rgb> values(light_count);
        surface->sample_row(view, lights, points, facet_count, true, {.values = values});
        return values.back().x;
      });
}

/// Paths of all bounces towards one light.
void add_walk(const std::string& name, const std::string& baseline, Arithmetic arithmetic, Sampler sampler) {
  add(name, baseline, facet_count,
      [=, surface = make_surface("ggx", "all"), lights = spread_lights(2), points = SamplePoints(sampler, {})] {
        Rgb value;
        surface->sample_row(view, std::span(lights).last(1), points, facet_count,
                            arithmetic == Arithmetic::vector_float, {.values = {&value, 1}});
        return value.x;
      });
}

void add_exact(const std::string& name, std::string_view distribution) {
  constexpr std::size_t count = 64;
  add(name, "", count, [surface = make_surface(distribution), lights = spread_lights(count)] {
    double sum = 0.0;
    for (const Direction& light : lights) sum += surface->exact(light, view).x;
    return sum;
  });
}

}  // namespace

void register_integrator() {
  add_facets("facets/ggx/philox", "", Distribution::ggx, Sampler::philox);
  add_facets("facets/ggx/sobol", "facets/ggx/philox", Distribution::ggx, Sampler::sobol);
  add_facets("facets/beckmann/philox", "facets/ggx/philox", Distribution::beckmann, Sampler::philox);
  add_facets("facets/beckmann/sobol", "facets/ggx/sobol", Distribution::beckmann, Sampler::sobol);

  add_row("samples/double/1_light", "", Arithmetic::plain_double, 1);
  add_row("samples/float/1_light", "samples/double/1_light", Arithmetic::vector_float, 1);
  add_row("samples/double/342_lights", "samples/double/1_light", Arithmetic::plain_double, line_size);
  add_row("samples/float/342_lights", "samples/double/342_lights", Arithmetic::vector_float, line_size);
  // Enough lights to hide the cost of the facets: what the inner loop itself can do.
  add_row("samples/float/5472_lights", "samples/double/342_lights", Arithmetic::vector_float, 16 * line_size);

  // Clock cycles and what a cycle can do: the ratio of the second to the first is to come near lanes × ports × 2.
  constexpr std::uint64_t rounds = 1 << 16;
  add("peak/clock_cycles", "", rounds, [] { return dependent_additions(rounds); });
  add("peak/multiply_add_operations", "peak/clock_cycles", rounds * operations_per_round(),
      [] { return multiply_adds(rounds); });
  add_row_operations("peak/table_operations/342_lights", line_size);
  add_row_operations("peak/table_operations/1368_lights", 4 * line_size);

  // One configuration: facets per second, against the same text without vectors.
  add("single/scalar/points_made_once", "", facet_count, [] { return scalar_lanes::mean_cosine(facet_count, true); });
  add("single/vector/points_made_once", "single/scalar/points_made_once", facet_count,
      [] { return vector_lanes::mean_cosine(facet_count, true); });
  add("single/scalar/anisotropic", "", facet_count, [] { return scalar_lanes::mean_cosine(facet_count, false); });
  add("single/vector/anisotropic", "single/scalar/anisotropic", facet_count,
      [] { return vector_lanes::mean_cosine(facet_count, false); });
  add("single/scalar/points_made_each_time", "", facet_count,
      [] { return scalar_lanes::points_and_cosines(facet_count); });
  add("single/vector/points_made_each_time", "single/scalar/points_made_each_time", facet_count,
      [] { return vector_lanes::points_and_cosines(facet_count); });
  add("single/vector/once_against_row", "single/vector/points_made_each_time", facet_count,
      [] { return vector_lanes::mean_cosine(facet_count, true); });

  constexpr std::uint32_t many = 1 << 14;
  // Paths of all bounces towards one light.
  add("walk/scalar/sobol", "", many, [] { return scalar_lanes::walk(many, false); });
  add("walk/vector/sobol", "walk/scalar/sobol", many, [] { return vector_lanes::walk(many, false); });
  add("walk/scalar/philox", "", many, [] { return scalar_lanes::walk(many, true); });
  add("walk/vector/philox", "walk/scalar/philox", many, [] { return vector_lanes::walk(many, true); });
  add_walk("walk/row/double", "", Arithmetic::plain_double, Sampler::sobol);
  add_walk("walk/row/float", "walk/row/double", Arithmetic::vector_float, Sampler::sobol);

  add_exact("exact/ggx", "ggx");
  add_exact("exact/beckmann", "beckmann");
}

}  // namespace lobefit
