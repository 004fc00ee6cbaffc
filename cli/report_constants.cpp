// The page of a refit of constants: tables of what was found, slices of the references, spheres of the models.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cli/report_folder.h"
#include "reference/metric.h"
#include "report/fit_text.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

/// Rows of one name: methods and sets of free parameters.
struct NamedRow {
  std::string name;
  std::vector<JsonReader> lines;
};

std::vector<NamedRow> named_rows(const JsonReader& result) {
  std::vector<NamedRow> rows;
  for (const JsonReader& line : result.at("rows").elements()) {
    const std::string name = line.at("name").text();
    const auto known = std::ranges::find(rows, name, &NamedRow::name);
    if (known == rows.end()) {
      rows.push_back({name, {line}});
    } else {
      known->lines.push_back(line);
    }
  }
  return rows;
}

FitParameter found(const std::string& name, const JsonReader& json) {
  const std::vector<double> interval = json.at("ci95").numbers();
  if (interval.size() != 2) throw json.at("ci95").error("expected two numbers", "write [low, high]");
  return {.name = name,
          .estimate = {.value = json.at("value").number(),
                       .standard_error = json.at("stderr").number(),
                       .ci_low = interval[0],
                       .ci_high = interval[1],
                       .at_bound = json.at("at_bound").boolean(),
                       .identifiable = json.at("identifiable").boolean()},
          .free = true};
}

/// The published constants, then what else any row frees.
std::vector<std::string> constant_names(const JsonReader& result) {
  std::vector<std::string> names;
  const auto add = [&](const JsonReader& object) {
    for (const auto& [name, value] : object.members()) {
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
    }
  };
  add(result.at("published"));
  for (const JsonReader& line : result.at("rows").elements()) add(line.at("params"));
  return names;
}

HtmlTable constants_table(const JsonReader& result) {
  HtmlTable table{.caption = "Constants", .header = {"row", "method", "free"}, .lines = {{"published", "", ""}}};
  const std::vector<std::string> names = constant_names(result);
  const JsonReader published = result.at("published");
  for (const std::string& name : names) {
    table.header.push_back(name);
    table.lines.front().push_back(published.has(name) ? fmt::format("{:g}", published.at(name).number()) : "");
  }
  for (const JsonReader& line : result.at("rows").elements()) {
    std::vector<std::string> cells{line.at("name").text(), line.at("method").text(), joined(texts(line.at("free")))};
    const JsonReader params = line.at("params"), fixed = line.at("fixed");
    for (const std::string& name : names) {
      cells.push_back(params.has(name)  ? interval_text(found(name, params.at(name)))
                      : fixed.has(name) ? fmt::format("({:g})", fixed.at(name).number())
                                        : "");
    }
    table.lines.push_back(std::move(cells));
  }
  table.note =
      "Intervals are 95 %, from the Monte Carlo error of the reference; exact references have none. Constants in "
      "parentheses were held.";
  return table;
}

HtmlTable errors_table(const JsonReader& result) {
  HtmlTable table{.caption = "Errors", .header = {"row", "method", "free", "metric"}};
  for (const auto& [label, value] : result.at("rows").elements().front().at("rms").members())
    table.header.push_back(label);
  for (const JsonReader& line : result.at("rows").elements()) {
    const JsonReader rms = line.at("rms");
    std::vector<std::string> cells{line.at("name").text(), line.at("method").text(), joined(texts(line.at("free"))),
                                   line.at("domain").at("metric").text()};
    for (std::size_t k = 4; k < table.header.size(); ++k)
      cells.push_back(fmt::format("{:.5f}", rms.at(table.header[k]).number()));
    table.lines.push_back(std::move(cells));
  }
  table.note =
      "rms over the row's domain, in its metric and with its weights: cosine is π f cos θi, brdf π f, log log(1 + f "
      "cos "
      "θi), cube_root (f cos θi)^⅓.";
  return table;
}

std::string domain_text(const JsonReader& line) {
  std::string text = "Reference ";
  for (const auto& [name, value] : line.at("reference").members()) {
    if (name == "name") {
      text += value.text();
    } else {
      text += ", " + name + " " + (value.value().is_string() ? value.text() : value.value().dump());
    }
  }
  const JsonReader domain = line.at("domain");
  text += "; model " + line.at("model").text() + "; views " + domain.at("views").text() + ", grid " +
          domain.at("grid").text();
  for (const auto& [name, values] : domain.at("axes").members()) {
    const std::vector<double> list = values.numbers();
    text += fmt::format(", {} {:g} … {:g} ({})", name, std::ranges::min(list), std::ranges::max(list), list.size());
  }
  const std::vector<std::string> weights = texts(domain.at("weights"));
  return text + "; metric " + domain.at("metric").text() + ", weights " +
         (weights.empty() ? "uniform" : joined(weights)) + ".";
}

/// The fitted values with the free ones as published.
ParameterValues published_values(const JsonReader& result, const JsonReader& line, const Fit& fit) {
  ParameterValues values = fit.values();
  const JsonReader published = line.has("published") ? line.at("published") : result.at("published");
  for (const std::string& name : texts(line.at("free"))) {
    if (!published.has(name)) continue;
    const JsonReader value = published.at(name);
    if (value.value().is_number()) {
      values.set(name, value.number());
    } else {
      values.set(name, value.numbers());
    }
  }
  return values;
}

/// The model's parameters in each of the table's rows, as far as there is a table.
HtmlSphere sphere_of(const Model& model, const ParameterValues& values, const Table* table, const std::string& label) {
  HtmlSphere sphere{.label = label, .rows = {}};
  if (!table) sphere.rows.emplace_back(values.flat().begin(), values.flat().end());
  for (std::size_t k = 0; table && k < table->parameter_rows(); ++k)
    sphere.rows.push_back(TableModel(model, values, *table).row(k));
  return sphere;
}

/// Throws if the table is not that on which the result stands.
void check_rms(const Table& table, const std::vector<float>& values, const JsonReader& line, const char* label) {
  const JsonReader stated = line.at("rms").at(label);
  const double rms = domain_rms(line.at("domain"), table, values);
  if (std::abs(rms - stated.number()) > 1e-6 * rms + 1e-9) {
    throw stated.error(fmt::format("the folder's table and fit give {:.9g}", rms), "run the recipe again");
  }
}

/// Slices and spheres of one row, from its fits; exact references before sampled ones.
void add_drawings(const NamedRow& named, const fs::path& folder, const JsonReader& result, FolderTables& tables,
                  HtmlRow& row, std::vector<std::string>& remarks) {
  const bool exact =
      std::ranges::any_of(named.lines, [](const JsonReader& l) { return l.at("method").text() == "exact"; });
  const std::string method = exact ? "exact" : named.lines.front().at("method").text();
  std::shared_ptr<const Table> reference;
  for (const JsonReader& line : named.lines) {
    if (line.at("method").text() != method) continue;
    std::string stem = named.name + "." + method;
    for (const std::string& name : texts(line.at("free"))) stem += "-" + name;
    const std::optional<FolderFit> found = folder_fit(folder / (stem + ".fit.json"));
    if (!found) {
      remarks.push_back("The folder lacks " + stem + ".fit.json: the row's drawings are without it.");
      continue;
    }
    const Model& model = find_model(found->fit.model);
    const std::shared_ptr<const Table> table = tables.find(found->table_sha256);
    if (!table) remarks.push_back("The folder lacks the table of " + stem + ".fit.json: no slices of it.");
    const ParameterValues published = published_values(result, line, found->fit), refit = found->fit.values();
    const std::string label = "refit " + joined(texts(line.at("free")));
    add_fit_quality(found->fit, named.lines.size() > 1 ? joined(texts(line.at("free"))) : "", row);
    if (row.explorer.spheres.empty())
      row.explorer.spheres.push_back(sphere_of(model, published, table.get(), "published"));
    row.explorer.spheres.push_back(sphere_of(model, refit, table.get(), label));
    row.explorer.model = &model;
    for (const std::string& name : texts(line.at("free"))) {
      if (std::ranges::find(row.explorer.fitted, name) == row.explorer.fitted.end())
        row.explorer.fitted.push_back(name);
    }
    if (!table || (reference && reference != table)) continue;
    const std::vector<float> of_published = TableModel(model, published, *table).render().values;
    const std::vector<float> of_refit = TableModel(model, refit, *table).render().values;
    check_rms(*table, of_published, line, "published");
    check_rms(*table, of_refit, line, "refit");
    if (!reference) {
      reference = table;
      row.slices = {.reference = table,
                    .label = table->model + (exact ? ", exact" : ", Monte Carlo"),
                    .quantity = parse_quantity(line.at("domain").at("metric").text()),
                    .lines = {{"published", of_published}}};
    }
    row.slices.lines.push_back({label, of_refit});
  }
  const bool surface = row.explorer.model && is_opaque_surface(*row.explorer.model);
  const bool shader = std::ranges::find(row.shaders, "glsl", &HtmlShader::language) != row.shaders.end();
  if (!surface || !shader) row.explorer = {};
}

}  // namespace

HtmlReport constants_report(const fs::path& folder, const JsonReader& result) {
  HtmlReport report = report_head(result);
  report.tables = {constants_table(result), errors_table(result)};
  FolderTables tables(folder);
  for (const NamedRow& named : named_rows(result)) {
    HtmlRow row{.name = named.name, .note = domain_text(named.lines.front())};
    row.shaders = folder_shaders(folder, named.name);
    if (row.shaders.empty()) report.remarks.push_back("The folder lacks the shaders of " + named.name + ".");
    add_drawings(named, folder, result, tables, row, report.remarks);
    report.rows.push_back(std::move(row));
  }
  // All of the first row's, then the rows' slices, then the rest.
  FolderFigures figures(folder);
  const std::vector<std::string> kinds{".slices", ".slices_oblique", ".residuals_retro", ".residuals_mirror"};
  for (const std::string& kind : kinds) figures.add(report.rows.front().name + kind, report.rows.front().figures);
  for (const std::string& kind : kinds) {
    for (std::size_t k = 1; k < report.rows.size(); ++k)
      figures.add(report.rows[k].name + kind, report.rows[k].figures);
  }
  figures.add_remark(report.remarks);
  return report;
}

}  // namespace lobefit
