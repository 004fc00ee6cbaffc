// lobefit table compare: how far two BRDFs are apart, in every metric.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/metrics_text.h"
#include "cli/slice.h"
#include "reference/metric.h"
#include "report/metrics_report.h"

namespace lobefit {

namespace {

struct CompareArguments {
  std::string first, second, weights = "uniform", metric = "cosine";
  std::vector<std::string> settings, mappings;
  double tolerance = 0.0;
  ReportOptions report;
};

/// A file's values at a table's entries, whatever its own grid; where it has none the table is masked.
std::vector<float> values_at_entries(const BrdfFile& file, Table& table) {
  std::vector<float> values(table.values.size());
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (!table.valid[entry]) continue;
    try {
      const Rgb f = file.evaluate(table.wi(entry), table.wo(entry));
      const std::array<double, 3> components{f.x, f.y, f.z};
      for (std::size_t c = 0; c < static_cast<std::size_t>(table.channels); ++c) {
        values[c * table.entries() + entry] = static_cast<float>(components[c]);
      }
    } catch (const Error&) {
      table.valid[entry] = 0;
    }
  }
  return values;
}

/// B on A's entries, and everything that the pair refers to.
struct Comparison {
  BrdfFile first;
  std::optional<BrdfFile> second;
  std::optional<ModelChoice> choice;
  std::optional<TableModel> model;
  std::vector<float> values;

  explicit Comparison(const CompareArguments& a) : first(read_brdf_file(a.first)) {
    Table& table = first.table;
    if (!is_file(a.second) || a.second.ends_with(".json")) {
      choice = choose_for_table(a.second, a.settings, a.mappings, table);
      model.emplace(*choice->model, choice->values, table, choice->mappings);
      values = model->render().values;
      return;
    }
    second = read_brdf_file(a.second);
    const Table& other = second->table;
    const bool measured = table.coordinates != Coordinates::spherical || other.coordinates != Coordinates::spherical;
    if (measured && !other.same_grid(table) && other.channels == table.channels && other.parameter_rows() == 1) {
      values = values_at_entries(*second, table);
    } else if (!other.same_grid(table) || other.channels != table.channels) {
      throw Error(ExitCode::invalid_input, "the tables have different axes", a.second,
                  "render both over the same grid; `lobefit table info` shows it");
    } else {
      values = other.values;
      for (std::size_t entry = 0; measured && entry < table.entries(); ++entry)
        table.valid[entry] &= other.valid[entry];
    }
  }
  BrdfPair pair() const {
    if (model) return model_pair(first, *model, values);
    return {.table = &first.table,
            .values = values,
            .truth = row_brdf(first),
            .other = row_brdf(*second),
            .isotropic = is_isotropic(first.table) && is_isotropic(second->table)};
  }
};

}  // namespace

void add_table_compare(CLI::App& tables, Context& context) {
  CLI::App* verb =
      tables.add_subcommand("compare",
                            "How far a second table, a model or a fit is from a table, in every metric\n"
                            "  lobefit table compare truth.exr other.exr --tolerance 1e-4\n"
                            "  lobefit table compare truth.exr chan_2024 --set multiple_scattering=0\n"
                            "  lobefit table compare aurora_white_rgb.bsdf fit.json\n"
                            "docs/metrics.md defines each figure. Where B has no value, A's entries do not count.");
  const auto a = std::make_shared<CompareArguments>();
  verb->add_option("A", a->first, "Table or measured file: the truth of relative errors")->required();
  verb->add_option("B", a->second, "Table file on the same grid, measured file on any, model, or fit (JSON)")
      ->required();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE of the model (repeatable)");
  add_repeatable(*verb, "--map", a->mappings, "NAME=SCALE*AXIS^POWER of the model (repeatable)");
  verb->add_option(
          "--weights", a->weights,
          "Of --tolerance's metric, and of JSON's `metrics`: uniform, or a product of sin_theta_i, sin_theta_o, "
          "cos_theta_i, cos_theta_o, quadrature, inverse_variance")
      ->capture_default_str();
  verb->add_option("--metric", a->metric, "Metric that --tolerance bounds: cosine, brdf, log, cube_root")
      ->capture_default_str();
  auto* tolerance = verb->add_option("--tolerance", a->tolerance, "Exit with 5 if the metric is larger");
  verb->add_option("--sphere", a->report.sphere_size, "Pixels across the spheres that are compared; 0 for none")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  verb->callback([&context, a, tolerance] {
    const Quantity bounded = parse_quantity(a->metric);
    const std::vector<WeightFactor> weights = parse_weights(a->weights);
    const Comparison comparison(*a);
    const Table& table = comparison.first.table;
    const MetricsReport report = metrics_report(comparison.pair(), a->report);
    Json metrics = Json::object();
    double found = 0.0;
    for (std::size_t q = 0; q < quantity_names.size(); ++q) {
      const auto quantity = static_cast<Quantity>(q);
      const double rms =
          weights.empty() ? report.brdf.rms[q].uniform
                          : rms_difference(table, comparison.values, quantity, entry_weights(table, weights, quantity));
      metrics[std::string(quantity_names[q])] = rms;
      if (quantity == bounded) found = rms;
    }
    const bool passed = tolerance->count() == 0 || found <= a->tolerance;
    if (context.json) {
      std::cout << Json{{"a", a->first},      {"b", a->second},   {"weights", a->weights},
                        {"metrics", metrics}, {"passed", passed}, {"report", report.json(table)}}
                       .dump(2)
                << "\n";
    } else {
      fmt::print("{}", metrics_text(report));
      for (const auto& [name, value] : metrics.items()) {
        if (!weights.empty()) fmt::print("  rms {:<15} {:.5g} by {}\n", name, value.get<double>(), a->weights);
      }
    }
    if (!passed) {
      throw Error(ExitCode::check_failed, fmt::format("rms {} {:.6g} exceeds {:g}", a->metric, found, a->tolerance),
                  a->second, "raise --tolerance only if the difference is meant");
    }
  });
}

}  // namespace lobefit
