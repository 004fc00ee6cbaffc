// What a page tells of one fit: parameters, errors, correlation, convergence; slices and spheres against its table.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cli/fit_job.h"
#include "cli/report_folder.h"
#include "evaluate/shader.h"
#include "reference/metric.h"
#include "reference/output_file.h"
#include "report/shader_text.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

HtmlTable parameters_table(const Fit& fit) {
  HtmlTable table{.caption = "Parameters",
                  .header = {"parameter", "value", "95 % interval", "misfit stderr", "range", "remark"}};
  for (const FitParameter& p : fit.parameters) {
    const bool interval = p.free && p.estimate.identifiable && !p.estimate.at_bound && p.estimate.standard_error > 0.0;
    table.lines.push_back({p.name, fmt::format("{:.6g}", p.estimate.value),
                           interval ? fmt::format("[{:.6g}, {:.6g}]", p.estimate.ci_low, p.estimate.ci_high) : "–",
                           p.free ? fmt::format("{:.2g}", p.estimate.misfit_standard_error) : "–",
                           fmt::format("{:g} … {:g}", p.lower, p.upper),
                           !p.free                    ? "held"
                           : !p.estimate.identifiable ? "not identifiable"
                           : p.estimate.at_bound      ? "at its bound"
                                                      : ""});
  }
  table.note =
      "Intervals are from the table's own errors, or how far a value would move had other directions been measured; "
      "the "
      "misfit's standard error is what a model that can't be exact leaves open.";
  return table;
}

/// Every number of an object and of those inside it; lists belong to the file alone.
void add_numbers(const JsonReader& object, const std::string& name, HtmlTable& table) {
  for (const auto& [key, member] : object.members()) {
    const std::string path = name.empty() ? key : name + ", " + key;
    if (member.value().is_object()) add_numbers(member, path, table);
    if (member.value().is_number()) table.lines.push_back({path, fmt::format("{:.6g}", member.number())});
  }
}

HtmlTable metrics_table(const JsonReader& json) {
  HtmlTable table{.caption = "Metrics", .header = {"metric", "value"}};
  add_numbers(json.at("metrics"), "rms", table);
  add_numbers(json.at("holdout"), "held-out rms", table);
  if (json.has("report")) add_numbers(json.at("report"), "", table);
  return table;
}

HtmlTable tiers_table(const JsonReader& tiers) {
  HtmlTable table{.caption = "What each tier buys", .header = {"tier", "free", "rms", "verdict"}};
  for (const JsonReader& tier : tiers.elements()) {
    std::string rms;
    for (const auto& [name, value] : tier.at("metrics").members())
      rms += fmt::format("{}{} {:.5f}", rms.empty() ? "" : ", ", name, value.number());
    table.lines.push_back({tier.at("tier").text(), fmt::format("{:g}", tier.at("free").number()), rms,
                           tier.has("verdict") ? tier.at("verdict").text() : ""});
  }
  return table;
}

/// The file that a fit was made on, where it still lies: as the fit names it, or in the fit's folder.
std::optional<fs::path> source_of(const fs::path& fit, const FitProvenance& provenance) {
  if (provenance.table.empty()) return std::nullopt;
  const fs::path name = provenance.table;
  for (const fs::path& path : {name, fit.parent_path() / name, fit.parent_path() / name.filename()}) {
    if (is_there(path) && sha256_of_file(path) == provenance.table_sha256) return path;
  }
  return std::nullopt;
}

/// Throws if the fit's own error is not that of its parameters over its table.
void check_error(const JsonReader& fit, const FitProvenance& provenance, const Table& table,
                 const std::vector<float>& values) {
  // Which entries a fit held out, its file does not say.
  if (!fit.at("holdout").value().empty()) return;
  const JsonReader stated = fit.at("metrics").at(provenance.metric);
  const Quantity quantity = parse_quantity(provenance.metric);
  const std::vector<WeightFactor> factors = parse_weights(provenance.weights.empty() ? "uniform" : provenance.weights);
  const double rms = rms_difference(table, values, quantity, entry_weights(table, factors, quantity));
  if (std::abs(rms - stated.number()) > 1e-6 * rms + 1e-9)
    throw stated.error(fmt::format("the parameters and the table give {:.9g}", rms), "fit again");
}

}  // namespace

void add_fit_quality(const Fit& fit, const std::string& label, HtmlRow& row) {
  const std::string title = label.empty() ? "" : ", " + label;
  const std::vector<double>& history = fit.solution.history;
  if (history.size() > 1) {
    HtmlChart chart{.title = "Convergence" + title,
                    .horizontal = "iteration",
                    .vertical = "root of the sum of squares",
                    .logarithmic = true,
                    .lines = {{"last descent", {}}}};
    for (std::size_t k = 0; k < history.size(); ++k)
      chart.lines.front().points.emplace_back(static_cast<double>(k), history[k]);
    chart.note =
        fmt::format("From {:.6g} to {:.6g} in {} iterations.", history.front(), history.back(), history.size() - 1);
    row.charts.push_back(std::move(chart));
  }
  if (fit.start_misfits.size() > 1) {
    HtmlChart chart{.title = "Starts" + title,
                    .horizontal = "start",
                    .vertical = "root of the sum of squares at its minimum",
                    .logarithmic = true,
                    .lines = {{"each start", {}, false}}};
    for (std::size_t k = 0; k < fit.start_misfits.size(); ++k)
      chart.lines.front().points.emplace_back(static_cast<double>(k + 1), fit.start_misfits[k]);
    chart.note = "Over the entries that starts run on; the best go on over all.";
    row.charts.push_back(std::move(chart));
  }
  HtmlMatrix matrix{.caption = "Correlation" + title, .names = {}, .values = fit.solution.correlation};
  for (const FitParameter& p : fit.parameters) {
    if (p.free) matrix.names.push_back(p.name);
  }
  matrix.note =
      "Between the free parameters, from the curvature at the minimum; 0 for those at a bound or without effect.";
  if (matrix.names.size() > 1 && matrix.values.size() == matrix.names.size()) row.matrices.push_back(std::move(matrix));
}

void add_fit_quality(const JsonReader& result, const JsonReader& parameters, const std::string& label, HtmlRow& row) {
  if (!result.has("correlation") || !result.has("history")) return;  // of an older version
  Fit fit;
  for (const auto& [name, parameter] : parameters.members()) fit.parameters.push_back({.name = name, .free = true});
  const JsonReader correlation = result.at("correlation");
  for (const JsonReader& line : correlation.elements()) {
    fit.solution.correlation.push_back(line.numbers());
    if (fit.solution.correlation.back().size() != fit.parameters.size())
      throw line.error(fmt::format("expected {} numbers", fit.parameters.size()), "run the recipe again");
  }
  if (fit.solution.correlation.size() != fit.parameters.size())
    throw correlation.error(fmt::format("expected {} lines", fit.parameters.size()), "run the recipe again");
  for (const JsonReader& misfit : result.at("history").elements()) fit.solution.history.push_back(misfit.number());
  add_fit_quality(fit, label, row);
}

HtmlRow fit_row(const std::string& name, const FolderFit& found, bool with_table, bool all_languages,
                const std::string& command, std::vector<std::string>& remarks) {
  const JsonReader reader(found.document, found.path.string());
  const FitProvenance provenance = fit_provenance(found.path.string());
  const Model& model = find_model(found.fit.model);
  const ParameterValues values = found.fit.values();
  HtmlRow row{.name = name,
              .note = fmt::format("{}; fitted data have SHA-256 {}.", model.info->title, found.table_sha256)};
  row.tables = {parameters_table(found.fit), metrics_table(reader)};
  if (reader.has("tiers")) row.tables.push_back(tiers_table(reader.at("tiers")));
  if (reader.has("remarks") && !reader.at("remarks").value().empty()) {
    HtmlTable table{.caption = "Remarks", .header = {"what the fit found"}};
    for (const std::string& remark : texts(reader.at("remarks"))) table.lines.push_back({remark});
    row.tables.push_back(std::move(table));
  }
  add_fit_quality(found.fit, "", row);
  for (const std::string& language : shader_languages()) {
    if (!all_languages && language != "glsl") continue;
    row.shaders.push_back(
        {language, shader_text(model, values, &found.fit, language, command, "Fitted constants of " + name)});
  }
  const bool surface = is_opaque_surface(model);
  if (surface)
    row.explorer = {.model = &model, .spheres = {{"fitted", {{values.flat().begin(), values.flat().end()}}}}};
  if (!with_table) return row;
  const std::optional<fs::path> source = source_of(found.path, provenance);
  if (!source) {
    remarks.push_back("The data of " + name + " are not where the fit found them: no slices and no reference of it.");
    return row;
  }
  const FitTable taken = read_fit_table({source->string(), provenance.material}, provenance.grid, provenance.weights);
  if (taken.file.table.coordinates != Coordinates::spherical) {
    remarks.push_back("The data of " + name + " are not on a grid of polar angles: no slices and no reference of it.");
    return row;
  }
  const auto table = std::make_shared<const Table>(taken.file.table);
  const TableModel on_table(model, values, *table, found.fit.mappings);
  const std::vector<float> fitted = on_table.render().values;
  check_error(reader, provenance, *table, fitted);
  row.slices = {.reference = table,
                .label = taken.dense ? "measured" : "table",
                .quantity = parse_quantity(provenance.metric),
                .lines = {{"fitted", fitted}}};
  if (!surface) return row;
  row.explorer.spheres.front().rows.clear();
  for (std::size_t k = 0; k < table->parameter_rows(); ++k)
    row.explorer.spheres.front().rows.push_back(on_table.row(k));
  return row;
}

std::vector<fs::path> folder_fits(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const auto& file : fs::directory_iterator(folder)) {
    if (file.path().extension() != ".json") continue;
    const Json json = parse_json(read_file(file.path()), file.path().string());
    if (file.path().string().ends_with(".fit.json") || (json.is_object() && json.contains("params")))
      paths.push_back(file.path());
  }
  std::ranges::sort(paths);
  return paths;
}

HtmlReport fits_report(const std::vector<fs::path>& paths, const std::string& command) {
  HtmlReport report;
  const bool complete = paths.size() <= most_complete_fits;
  HtmlTable errors{.caption = "Errors", .header = {"fit", "model", "state", "metric", "rms", "held-out rms"}};
  for (const fs::path& path : paths) {
    const FolderFit found = *folder_fit(path);
    const JsonReader reader(found.document, path.string());
    std::string name = path.stem().string();
    if (name.ends_with(".fit")) name.resize(name.size() - 4);
    const std::string metric = fit_provenance(path.string()).metric;
    const auto text = [&](const char* part) {
      const JsonReader metrics = reader.at(part);
      return metrics.has(metric) ? fmt::format("{:.5f}", metrics.at(metric).number()) : "–";
    };
    errors.lines.push_back({name, found.fit.model,
                            reader.at("solver").at("converged").boolean() ? "converged" : "not converged", metric,
                            text("metrics"), text("holdout")});
    report.rows.push_back(fit_row(name, found, complete, complete, command, report.remarks));
    const JsonReader provenance = reader.at("provenance");
    if (paths.size() > 1) continue;
    report.title = found.fit.model + " fitted to " +
                   (provenance.has("table") ? fs::path(provenance.at("table").text()).filename().string() : name);
    report.command = provenance.at("command").text();
    add_provenance(provenance, report);
  }
  if (paths.size() > 1) report.title = fmt::format("{} fits", paths.size());
  report.tables = {errors};
  return report;
}

}  // namespace lobefit
