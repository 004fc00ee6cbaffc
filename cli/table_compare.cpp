// lobefit table compare: how far two BRDFs are apart, in every metric.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/metrics_text.h"
#include "cli/slice.h"
#include "reference/metric.h"
#include "report/table_comparison.h"

namespace lobefit {

namespace {

struct CompareArguments {
  std::string first, second, weights = "uniform", metric = "cosine";
  std::vector<std::string> settings, mappings;
  double tolerance = 0.0;
  ReportOptions report;
};

TableComparison compare(const CompareArguments& a) {
  BrdfFile first = read_brdf_file(a.first);
  if (is_file(a.second) && !a.second.ends_with(".json"))
    return TableComparison(std::move(first), read_brdf_file(a.second), a.second);
  const ModelChoice choice = choose_for_table(a.second, a.settings, a.mappings, first.table);
  return TableComparison(std::move(first), *choice.model, choice.values, choice.mappings);
}

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
    const TableComparison comparison = compare(*a);
    const Table& table = comparison.table();
    const MetricsReport report = metrics_report(comparison.pair(), a->report);
    Json metrics = Json::object();
    double found = 0.0;
    for (std::size_t q = 0; q < quantity_names.size(); ++q) {
      const auto quantity = static_cast<Quantity>(q);
      const double rms = weights.empty() ? report.brdf.rms[q].uniform
                                         : rms_difference(table, comparison.values(), quantity,
                                                          entry_weights(table, weights, quantity));
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
