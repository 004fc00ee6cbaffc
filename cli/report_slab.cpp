// Pages of Substrate: what simplifying a tree costs, and the rules that it is done by.
#include <fmt/format.h>

#include <algorithm>

#include "cli/report_folder.h"
#include "cli/substrate_rules.h"
#include "evaluate/shader.h"
#include "fit/substrate_rules.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

std::string error_text(const JsonReader& errors, const char* name) {
  return errors.has(name) ? fmt::format("{:.4f}", errors.at(name).number()) : "–";
}

HtmlTable stages_table(const std::string& strategy, const JsonReader& stages) {
  HtmlTable table{.caption = "Stages, " + strategy,
                  .header = {"bytes", "closures", "last step", "simplification", "its brdf", "its albedo",
                             "its sphere, ΔE_ITP", "model", "its brdf", "its albedo", "its sphere, ΔE_ITP"}};
  for (const JsonReader& stage : stages.elements()) {
    const std::vector<std::string> steps = texts(stage.at("steps"));
    std::vector<std::string> cells{fmt::format("{:g}", stage.at("bytes").number()),
                                   fmt::format("{:g}", stage.at("closures").number()),
                                   steps.empty()                ? "the full tree"
                                   : strategy == "error_driven" ? joined(steps)
                                                                : steps.back()};
    for (const char* against : {"simplification", "model"}) {
      for (const char* error : {"error", "brdf_rms_log", "albedo_rms_relative", "sphere_delta_e_itp"})
        cells.push_back(error_text(stage.at(against), error));
    }
    table.lines.push_back(std::move(cells));
  }
  return table;
}

/// Error against bytes, a line per strategy.
HtmlChart stages_chart(const JsonReader& strategies, const char* against, const std::string& title) {
  HtmlChart chart{.title = title, .horizontal = "bytes per pixel", .vertical = "error of BRDF and directional albedo"};
  for (const auto& [strategy, stages] : strategies.members()) {
    HtmlChart::Line line{.label = strategy, .points = {}};
    for (const JsonReader& stage : stages.elements())
      line.points.emplace_back(stage.at("bytes").number(), stage.at(against).at("error").number());
    chart.lines.push_back(std::move(line));
  }
  return chart;
}

/// A validation as a row.
HtmlRow validation_row(const std::string& name, const JsonReader& validation) {
  HtmlRow row{.name = name};
  row.note = fmt::format(
      "Simplification is the error against the full tree, model that against the layers as matter, whose albedos are "
      "known to {:.2g} relative. Errors are the rms of brdf, that of log(1 + 20 f cos θ), and albedo, the relative one "
      "of directional albedos.",
      validation.at("truth_error").number());
  for (const std::string& note : texts(validation.at("notes"))) row.note += " Left out of matter: " + note + ".";
  const JsonReader strategies = validation.at("strategies");
  row.charts = {stages_chart(strategies, "model", "Against the layers as matter"),
                stages_chart(strategies, "simplification", "Against the full tree")};
  for (const auto& [strategy, stages] : strategies.members()) row.tables.push_back(stages_table(strategy, stages));
  if (validation.has("exact_statistics")) {
    const JsonReader exact = validation.at("exact_statistics");
    row.tables.push_back(
        {.caption = "Statistics of coverage",
         .header = {"shown by", "closures", "differs from the other by", "error against matter"},
         .lines = {{"all events apart", fmt::format("{:g}", exact.at("closures").number()),
                    error_text(exact.at("difference"), "error"), error_text(exact.at("model"), "error")}},
         .note = "The other is the one virtual slab above each closure, which all else on this page is made with."});
  }
  return row;
}

HtmlTable constants_table(const JsonReader& constants) {
  HtmlTable table{.caption = "Constants", .header = {"constant", "symbol", "value", "95 % interval", "meaning"}};
  for (const auto& [name, constant] : constants.members()) {
    const std::vector<double> interval = constant.at("ci95").numbers();
    if (interval.size() != 2) throw constant.at("ci95").error("expected two numbers", "write [low, high]");
    table.lines.push_back({name, constant.at("symbol").text(), fmt::format("{:.4f}", constant.at("value").number()),
                           constant.at("at_bound").boolean() ? "at its bound"
                           : !constant.at("identifiable").boolean()
                               ? "not identifiable"
                               : fmt::format("[{:.4f}, {:.4f}]", interval[0], interval[1]),
                           constant.at("doc").text()});
  }
  table.note = "Intervals are over the drawn pairs.";
  return table;
}

std::string quantiles_text(const JsonReader& q) {
  return fmt::format("{:.3f} / {:.3f} / {:.3f}", q.at("median").number(), q.at("p90").number(), q.at("max").number());
}

HtmlTable pairs_table(const JsonReader& result) {
  HtmlTable table{.caption = "Errors over held-out pairs",
                  .header = {"bottom, medium, interface", "n", "baseline", "tree", "fitted", "fitted, haze"}};
  for (const JsonReader& row : result.at("rows").elements()) {
    const JsonReader domain = row.at("domain"), error = row.at("albedo_error");
    const double count = error.at("fitted").at("count").number();
    if (count == 0.0) continue;
    table.lines.push_back(
        {domain.at("bottom").text() + ", " + domain.at("medium").text() + ", " + domain.at("interface").text(),
         fmt::format("{:g}", count)});
    for (const char* way : {"baseline", "tree", "fitted", "fitted_haze"})
      table.lines.back().push_back(quantiles_text(error.at(way)));
  }
  const JsonReader mixes = result.at("mixes");
  table.note =
      "Relative error of directional albedos, median / P90 / max. Mixes: rms of the difference of "
      "log(1 + 20 f cos θ), baseline " +
      quantiles_text(mixes.at("baseline")) + ", fitted " + quantiles_text(mixes.at("fitted")) + ", fitted with haze " +
      quantiles_text(mixes.at("fitted_haze")) + ".";
  return table;
}

HtmlTable budgets_table(const JsonReader& budgets) {
  HtmlTable table{
      .caption = "Shipped trees: error against bytes",
      .header = {"bytes", "trees", "baseline", "fitted", "error-driven", "error-driven over baseline", "times above"}};
  for (const JsonReader& budget : budgets.elements()) {
    table.lines.push_back({fmt::format("{:g}", budget.at("bytes").number()),
                           fmt::format("{:g}", budget.at("trees").number()), error_text(budget, "baseline"),
                           error_text(budget, "fitted"), error_text(budget, "error_driven"),
                           fmt::format("{:.2f}", budget.at("ratio").number()),
                           fmt::format("{:g}", budget.at("above_baseline").number())});
  }
  table.note = "Least error against the layers as matter within the budget, medians over the trees that fit it.";
  return table;
}

HtmlChart budgets_chart(const JsonReader& budgets) {
  HtmlChart chart{.title = "Median over the shipped trees",
                  .horizontal = "bytes per pixel",
                  .vertical = "error against the layers as matter"};
  for (const char* way : {"baseline", "fitted", "error_driven"}) {
    HtmlChart::Line line{.label = way, .points = {}};
    for (const JsonReader& budget : budgets.elements())
      line.points.emplace_back(budget.at("bytes").number(), budget.at(way).number());
    chart.lines.push_back(std::move(line));
  }
  return chart;
}

}  // namespace

HtmlReport slab_report(const fs::path& folder, const JsonReader& validation) {
  const JsonReader provenance = validation.at("provenance");
  const std::string command = provenance.at("command").text();
  // Results of older versions have no title.
  HtmlReport report{.title = "What simplifying " +
                             (validation.has("title") ? validation.at("title").text() : std::string("a tree")) +
                             " costs",
                    .command = command};
  add_provenance(provenance, report);
  HtmlRow row = validation_row("Stages of simplifying", validation);
  const fs::path rules = shipped_rules();
  if (is_there(rules) && provenance.has("rules_sha256") &&
      provenance.at("rules_sha256").text() == sha256_of_file(rules)) {
    for (const std::string& language : shader_languages())
      row.shaders.push_back({language, rules_shader(language, read_rules(rules), command)});
  } else {
    report.remarks.push_back(
        "The rules are others than the shipped ones: `lobefit slab shader --rules FILE` writes their shader.");
  }
  FolderFigures figures(folder);
  for (const char* stem : {"tree", "error"}) figures.add(stem, row.figures);
  figures.add_remark(report.remarks);
  report.rows.push_back(std::move(row));
  return report;
}

HtmlReport substrate_report(const fs::path& folder, const JsonReader& result) {
  HtmlReport report = report_head(result);
  report.tables = {constants_table(result.at("constants")), pairs_table(result), budgets_table(result.at("budgets"))};
  report.charts = {budgets_chart(result.at("budgets"))};
  HtmlRow rules{.name = "the rules", .note = "What makes one slab of two, for the view that the base pass knows."};
  rules.shaders = folder_shaders(folder, "substrate_rules");
  if (rules.shaders.empty()) report.remarks.emplace_back("The folder lacks the rules' shaders.");
  add_fit_quality(result, result.at("constants"), "", rules);
  FolderFigures figures(folder);
  figures.add("trees", rules.figures);
  figures.add_remark(report.remarks);
  report.rows.push_back(std::move(rules));
  for (const auto& [name, validation] : result.at("trees").members())
    report.rows.push_back(validation_row(name, validation));
  return report;
}

}  // namespace lobefit
