// The microfacet-diffuse reference on one core. A sample is one facet against one light.
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "bench/benchmarks.h"
#include "reference/diffuse/microfacet_diffuse.h"
#include "reference/references.h"
#include "reference/visible_normals.h"

namespace lobefit {

namespace {

constexpr double alpha = 0.5;
constexpr std::uint32_t facet_count = 2048;  // one replicate of the default number of samples
constexpr std::size_t line_size = 18 * 19;   // lights that share a view in the default grid
const Direction view = direction(radians(50.0), 0.0);

std::shared_ptr<const Integrator> make_surface(std::string_view distribution) {
  ParameterValues values = find_reference(MicrofacetDiffuse::name).defaults();
  values.set("alpha", alpha);
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

  add_exact("exact/ggx", "ggx");
  add_exact("exact/beckmann", "beckmann");
}

}  // namespace lobefit
