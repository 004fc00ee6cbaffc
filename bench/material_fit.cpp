// A fit of a measured material, all starts included, on one core: 50,000 directions × RGB. An item is one direction.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <cmath>

#include "bench/benchmarks.h"
#include "fit/fit.h"
#include "reference/table_model.h"

namespace lobefit {

namespace {

/// A satin plastic on Grid::measured(), off by a few per cent from anything that Callisto can be.
Table make_table() {
  const Model& model = find_model("callisto");
  ParameterValues values = model.defaults();
  values.set("albedo", std::vector{0.4, 0.2, 0.1});
  values.set("alpha", 0.15);
  values.set("retroreflection", 1.8);
  values.set("diffuse_fresnel", 0.6);
  values.set("dual_specular_roughness_scale", 2.0);
  values.set("dual_specular_opacity", 0.4);
  Table grid;
  grid.grid = Grid::measured();
  grid.channels = 3;
  grid.allocate();
  Table table = TableModel(model, values, grid).render();
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const double ripple = 1.0 + 0.05 * std::sin(6.0 * table.wi(entry).x) * std::cos(4.0 * table.wo(entry).x);
    for (std::size_t c = 0; c < 3; ++c)
      table.values[c * table.entries() + entry] =
          static_cast<float>(ripple * table.values[c * table.entries() + entry]);
  }
  return table;
}

FitOptions make_options(const Table& table) {
  FitOptions options{.free = free_parameters(find_model("callisto").defaults(), table, {}, Tier::full)};
  options.weights = parse_weights("sin_theta_i,sin_theta_o");
  options.staged = true;
  options.starts = 6;
  options.most_entries = 50000;
  options.tolerance = 1e-3;
  options.intervals = Intervals::blocks;
  return options;
}

constexpr std::int64_t directions = 50000;

}  // namespace

void register_material_fit() {
  benchmark::RegisterBenchmark("fit/evaluate", [](benchmark::State& state) {
    const Table table = make_table();
    const Model& model = find_model("callisto");
    const ParameterValues values = model.defaults();
    std::vector<Direction> wi, wo;
    for (std::size_t entry = 0; entry < static_cast<std::size_t>(directions); ++entry) {
      wi.push_back(table.wi(3 * entry));
      wo.push_back(table.wo(3 * entry));
    }
    std::vector<Rgb> colors(wi.size());
    for (auto _ : state) {
      model.evaluate_all(values.flat(), wi, wo, colors);
      benchmark::DoNotOptimize(colors.data());
    }
    state.SetItemsProcessed(state.iterations() * directions);
  });
  benchmark::RegisterBenchmark("fit/callisto", [](benchmark::State& state) {
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    const Table table = make_table();
    const Model& model = find_model("callisto");
    const FitOptions options = make_options(table);
    Monitor silent;
    for (auto _ : state) benchmark::DoNotOptimize(fit(model, model.defaults(), table, options, silent));
    state.SetItemsProcessed(state.iterations() * directions);
    state.SetLabel("fit/evaluate");
  })->Unit(benchmark::kSecond);
}

}  // namespace lobefit
