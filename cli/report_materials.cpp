// The page of fits to several materials: how well each is met, its parameters, and its sphere.
#include <fmt/format.h>

#include <algorithm>

#include "cli/report_folder.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

/// A number or "–".
std::string metric_text(const JsonReader& metrics, const std::string& name) {
  return metrics.has(name) ? fmt::format("{:.5f}", metrics.at(name).number()) : "–";
}

HtmlTable errors_table(const JsonReader& summary) {
  HtmlTable table{.caption = "Errors", .header = {"material", "state"}};
  std::vector<std::string> metrics, held_out;
  const std::vector<JsonReader> fits = summary.at("fits").elements();
  for (const auto& [name, value] : fits.front().at("metrics").members()) metrics.push_back(name);
  for (const auto& [name, value] : fits.front().at("holdout").members()) held_out.push_back(name);
  for (const std::string& name : metrics) table.header.push_back("rms " + name);
  for (const std::string& name : held_out) table.header.push_back("held-out rms " + name);
  for (const JsonReader& fit : fits) {
    std::vector<std::string> cells{fit.at("material").text(),
                                   fit.at("converged").boolean() ? "converged" : "not converged"};
    for (const std::string& name : metrics) cells.push_back(metric_text(fit.at("metrics"), name));
    for (const std::string& name : held_out) cells.push_back(metric_text(fit.at("holdout"), name));
    table.lines.push_back(std::move(cells));
  }
  for (const JsonReader& failure : summary.at("failures").elements()) {
    table.lines.push_back({failure.at("material").text(), "failed: " + failure.at("message").text()});
    table.lines.back().resize(table.header.size());
  }
  return table;
}

HtmlTable spread_table(const JsonReader& summary) {
  HtmlTable table{.caption = "Errors over all materials", .header = {"rms", "median", "95th percentile", "worst"}};
  for (const auto& [name, spread] : summary.at("quantiles").members()) {
    table.lines.push_back(
        {name, metric_text(spread, "median"), metric_text(spread, "p95"), metric_text(spread, "worst")});
  }
  return table;
}

}  // namespace

HtmlReport materials_report(const fs::path& folder, const JsonReader& summary, const std::string& command) {
  const JsonReader provenance = summary.at("provenance");
  const std::string model_name = summary.at("model").text();
  const std::vector<JsonReader> fits = summary.at("fits").elements();
  if (fits.empty()) throw summary.at("fits").error("no material was fitted", "see its failures");
  HtmlReport report{.title = fmt::format("{} fitted to {} materials", model_name, fits.size()),
                    .command = provenance.at("command").text()};
  report.tables = {errors_table(summary), spread_table(summary)};
  add_provenance(provenance, report);

  FolderFigures figures(folder);
  const bool complete = fits.size() <= most_complete_fits;
  for (const JsonReader& line : fits) {
    const std::string material = line.at("material").text();
    if (const std::optional<FolderFit> found = folder_fit(folder / line.at("fit").text())) {
      report.rows.push_back(fit_row(material, *found, complete, complete, command, report.remarks));
    } else {
      report.rows.push_back({.name = material});
      report.remarks.push_back("The folder lacks " + line.at("fit").text() + ".");
    }
    figures.add(material, report.rows.back().figures);
  }
  if (!complete) {
    report.remarks.push_back(
        "Of so many materials the page has neither slices nor shaders other than GLSL; `lobefit export FIT.json` "
        "writes "
        "them.");
  }
  figures.add_remark(report.remarks);
  return report;
}

}  // namespace lobefit
