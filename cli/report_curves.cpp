// The page of a recipe of curves: every reference and albedo against each model, alpha by alpha.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "cli/report_folder.h"
#include "evaluate/shader.h"
#include "reference/metric.h"
#include "report/shader_text.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

/// The rows of one model against one reference of one albedo: alphas in order, contested parameters free and fixed.
struct Contest {
  std::string model, table;
  double albedo = 1.0;
  std::vector<JsonReader> free, fixed;

  std::string surface() const { return fmt::format("{}, albedo {:g}", table, albedo); }
  std::string name() const { return model + " on " + surface(); }
};

std::vector<Contest> contests(const JsonReader& result) {
  const std::string contested = result.at("contested").text();
  std::vector<Contest> list;
  for (const JsonReader& row : result.at("rows").elements()) {
    const std::string model = row.at("model").text(), table = row.at("table").text();
    const double albedo = row.at("albedo").number();
    auto known = std::ranges::find_if(
        list, [&](const Contest& c) { return c.model == model && c.table == table && c.albedo == albedo; });
    if (known == list.end()) known = list.insert(list.end(), {model, table, albedo, {}, {}});
    (row.at(contested).text() == "free" ? known->free : known->fixed).push_back(row);
  }
  for (const Contest& contest : list) {
    if (contest.free.size() == contest.fixed.size() && !contest.free.empty()) continue;
    throw result.at("rows").error("rows of " + contest.name() + " are missing", "run the recipe again");
  }
  return list;
}

std::string number_text(const JsonReader& number) { return fmt::format("{:.4f}", number.number()); }

/// Errors of every model on one reference and albedo.
HtmlTable errors_table(const std::vector<Contest>& list, const Contest& first, const std::string& contested) {
  HtmlTable table{.caption = "rms on " + first.surface(), .header = {"α"}};
  for (const JsonReader& row : first.free) table.lines.push_back({fmt::format("{:g}", row.at("alpha").number())});
  for (const Contest& contest : list) {
    if (contest.surface() != first.surface()) continue;
    for (const char* state : {"free", "fixed"}) table.header.push_back(contest.model + ", " + contested + " " + state);
    table.header.emplace_back("fixed over free");
    for (std::size_t k = 0; k < table.lines.size() && k < contest.free.size(); ++k) {
      const JsonReader free = contest.free[k].at("rms").at("refit"), fixed = contest.fixed[k].at("rms").at("refit");
      table.lines[k].push_back(number_text(free));
      table.lines[k].push_back(number_text(fixed));
      table.lines[k].push_back(fmt::format("{:.2f}", fixed.number() / free.number()));
    }
  }
  for (auto& line : table.lines) line.resize(table.header.size());
  return table;
}

HtmlTable comparisons_table(const JsonReader& result) {
  HtmlTable table{.caption = "What is called negligible",
                  .header = {"comparison", "α", "model", "without c1", "effect of c1", "missed", "missed over effect"}};
  for (const JsonReader& row : result.at("comparisons").elements()) {
    const JsonReader rms = row.at("rms");
    table.lines.push_back({row.at("name").text(), fmt::format("{:g}", row.at("alpha").number()),
                           number_text(rms.at("shipped")), number_text(rms.at("plain")), number_text(rms.at("effect")),
                           number_text(rms.at("missed_effect")),
                           fmt::format("{:.2f}", rms.at("missed_effect").number() / rms.at("effect").number())});
  }
  table.note =
      "rms of the model against facets that carry c1 themselves, and without c1 on either side; what c1 does to the "
      "facets, and by how much what it does to the model misses that.";
  return table;
}

std::string estimate_text(const JsonReader& row, const std::string& name) {
  const JsonReader params = row.at("params");
  if (!params.has(name)) {
    return row.at("fixed").has(name) ? fmt::format("({:g})", row.at("fixed").at(name).number()) : "";
  }
  const JsonReader estimate = params.at(name);
  std::string text = fmt::format("{:.4g}", estimate.at("value").number());
  if (!estimate.at("identifiable").boolean()) return text + ", undecided";
  if (!estimate.at("at_bound").boolean())
    return text + fmt::format(" ± {:.2g}", 1.96 * estimate.at("misfit_stderr").number());
  text += ", at its bound";
  if (row.has("beyond_bounds"))
    text += fmt::format("; beyond {:.4g}", row.at("beyond_bounds").at("params").at(name).at("value").number());
  return text;
}

/// Parameters over alpha, of one state of a contest.
HtmlTable parameters_table(const std::vector<JsonReader>& rows, const std::vector<std::string>& names,
                           const std::string& state) {
  HtmlTable table{.caption = "Parameters, " + state, .header = {"α"}};
  for (const std::string& name : names) table.header.push_back(name);
  for (const char* column : {"rms", "rms of the curves", "rms beyond bounds", "rms of the lowest minimum"})
    table.header.emplace_back(column);
  for (const JsonReader& row : rows) {
    std::vector<std::string> cells{fmt::format("{:g}", row.at("alpha").number())};
    for (const std::string& name : names) cells.push_back(estimate_text(row, name));
    cells.push_back(number_text(row.at("rms").at("refit")) + (row.at("converged").boolean() ? "" : " (not converged)"));
    cells.push_back(number_text(row.at("rms").at("curve")));
    cells.push_back(row.has("beyond_bounds") ? number_text(row.at("beyond_bounds").at("rms")) : "–");
    cells.push_back(row.has("lowest") ? number_text(row.at("lowest").at("rms")) + " (not usable)" : "–");
    table.lines.push_back(std::move(cells));
  }
  table.note = "± is 95 % from the misfit. Values in parentheses were held.";
  return table;
}

HtmlTable curves_table(const JsonReader& result, const Contest& contest, const std::string& contested) {
  HtmlTable table{.caption = "Curves over α", .header = {contested, "parameter", "1", "√α", "α", "from", "to"}};
  for (const JsonReader& curve : result.at("curves").elements()) {
    if (curve.at("model").text() != contest.model || curve.at("table").text() != contest.table ||
        curve.at("albedo").number() != contest.albedo)
      continue;
    const std::string state = curve.at(contested).text();
    for (const auto& [name, parameter] : curve.at("parameters").members()) {
      std::vector<std::string> cells{state, name};
      for (const double c : parameter.at("coefficients").numbers()) cells.push_back(fmt::format("{:.4f}", c));
      for (const char* bound : {"lower", "upper"}) cells.push_back(fmt::format("{:g}", parameter.at(bound).number()));
      cells.resize(table.header.size());
      table.lines.push_back(std::move(cells));
    }
    table.note += fmt::format("{}, {} {}, they lose at most {:.1f} % against the fits alpha by alpha.",
                              table.note.empty() ? "Coefficients, clamped from … to. With" : " With", contested, state,
                              100.0 * curve.at("worst_loss").number());
  }
  return table;
}

HtmlChart errors_chart(const std::vector<Contest>& list, const Contest& first, const std::string& state) {
  HtmlChart chart{.title = first.surface() + ", " + state, .horizontal = "α", .vertical = "rms"};
  for (const Contest& contest : list) {
    if (contest.surface() != first.surface()) continue;
    HtmlChart::Line line{.label = contest.model, .points = {}};
    for (const JsonReader& row : state.ends_with("free") ? contest.free : contest.fixed)
      line.points.emplace_back(row.at("alpha").number(), row.at("rms").at("refit").number());
    chart.lines.push_back(std::move(line));
  }
  return chart;
}

/// Fits may lie outside of a parameter's range: the flat array takes what ParameterValues::set() refuses.
std::vector<double> row_values(const Model& model, const JsonReader& row) {
  ParameterValues values = model.defaults();
  const auto set = [&](const std::string& name, const JsonReader& value) {
    const std::size_t dot = name.find('.');
    if (!values.has(name.substr(0, dot)))
      throw value.error(row.at("model").text() + " has no such parameter", "run the recipe again");
    const ParameterInfo& info = values.info(name.substr(0, dot));
    const auto first = values.flat().begin() + info.offset;
    if (dot == std::string::npos) {
      std::fill(first, first + info.components, value.number());
    } else {
      first[static_cast<std::ptrdiff_t>(std::string_view("rgb").find(name.back()))] = value.number();
    }
  };
  for (const auto& [name, value] : row.at("fixed").members()) set(name, value);
  for (const auto& [name, estimate] : row.at("params").members()) set(name, estimate.at("value"));
  return {values.flat().begin(), values.flat().end()};
}

ParameterValues as_values(const Model& model, const std::vector<double>& flat) {
  ParameterValues values = model.defaults();
  std::ranges::copy(flat, values.flat().begin());
  return values;
}

/// The rows' parameters over their table. Throws if a row's rms is not what they give.
std::vector<float> rendered(const Model& model, const Table& table, const Contest& contest,
                            const std::vector<JsonReader>& rows, HtmlSphere& sphere) {
  std::vector<float> values;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const JsonReader stated = rows[k].at("rms").at("refit");
    const Table slice = table.row_slice(k);
    sphere.rows.push_back(row_values(model, rows[k]));
    const std::vector<float> part = TableModel(model, as_values(model, sphere.rows.back()), slice).render().values;
    const double rms = domain_rms(rows[k].at("domain"), slice, part) / contest.albedo;
    if (std::abs(rms - stated.number()) > 1e-5 * rms + 1e-9)
      throw stated.error(fmt::format("the folder's table and the row's parameters give {:.9g}", rms),
                         "run the recipe again");
    values.insert(values.end(), part.begin(), part.end());
  }
  return values;
}

/// Slices, spheres and shaders of one contest.
void add_drawings(const JsonReader& result, const Contest& contest, std::shared_ptr<const Table> table, HtmlRow& row) {
  const Model& model = find_model(contest.model);
  const std::string contested = result.at("contested").text(), command = result.at("provenance").at("command").text();
  HtmlSphere free{.label = contested + " free", .rows = {}}, fixed{.label = contested + " fixed", .rows = {}};
  if (table) {
    if (table->parameter_rows() != contest.free.size())
      throw result.at("rows").error(contest.table + ".exr has other alphas", "run the recipe again");
    row.slices = {.reference = table,
                  .label = contest.surface(),
                  .quantity = Quantity::cosine,
                  .lines = {{free.label, rendered(model, *table, contest, contest.free, free)},
                            {fixed.label, rendered(model, *table, contest, contest.fixed, fixed)}}};
  } else {
    const std::size_t middle = contest.free.size() / 2;
    free.rows = {row_values(model, contest.free[middle])};
    fixed.rows = {row_values(model, contest.fixed[middle])};
  }
  row.explorer = {.model = &model, .spheres = {free, fixed}, .fitted = texts(contest.free.front().at("free"))};
  const std::size_t shown = contest.free.size() * 2 / 3;
  const double alpha = contest.free[shown].at("alpha").number();
  for (const auto* rows : {&contest.free, &contest.fixed}) {
    const JsonReader& one = (*rows)[shown];
    add_fit_quality(one, one.at("params"), fmt::format("{} {}, α = {:g}", contested, one.at(contested).text(), alpha),
                    row);
  }
  for (const std::string& language : shader_languages()) {
    row.shaders.push_back(
        {language, shader_text(model, as_values(model, row_values(model, contest.free[shown])), nullptr, language,
                               command, fmt::format("{}, {} free, at alpha {:g}", contest.name(), contested, alpha))});
  }
}

}  // namespace

HtmlReport curves_report(const fs::path& folder, const JsonReader& result) {
  HtmlReport report = report_head(result);
  const std::string contested = result.at("contested").text();
  const std::vector<Contest> list = contests(result);
  std::map<std::string, std::shared_ptr<const Table>> tables;  // by surface; null where the folder lacks one
  for (const Contest& contest : list) {
    const auto [place, fresh] = tables.emplace(contest.surface(), nullptr);
    if (!fresh) continue;
    report.tables.push_back(errors_table(list, contest, contested));
    for (const char* state : {" free", " fixed"})
      report.charts.push_back(errors_chart(list, contest, contested + state));
    const fs::path path = folder / (contest.table + ".exr");
    if (!is_there(path)) {
      report.remarks.push_back("The folder lacks " + contest.table + ".exr: no slices and no reference of it.");
      continue;
    }
    Table table = Table::read(path).with_albedo({contest.albedo, contest.albedo, contest.albedo});
    table.orders = 0;
    for (std::vector<float>* part : {&table.order_values, &table.order_stderr, &table.order_replicates}) part->clear();
    place->second = std::make_shared<const Table>(std::move(table));
  }
  if (!result.at("comparisons").value().empty()) report.tables.push_back(comparisons_table(result));

  FolderFigures figures(folder);
  std::set<std::string> drawn;  // each figure once
  for (const Contest& contest : list) {
    HtmlRow row{.name = contest.name()};
    const JsonReader domain = contest.free.front().at("domain");
    row.note = "Fitted alpha by alpha in the metric " + domain.at("metric").text() + ", weights " +
               joined(texts(domain.at("weights"))) + "; rms is per unit of albedo.";
    const std::vector<std::string> names = texts(contest.free.front().at("free"));
    row.tables = {parameters_table(contest.free, names, contested + " free"),
                  parameters_table(contest.fixed, names, contested + " fixed"),
                  curves_table(result, contest, contested)};
    add_drawings(result, contest, tables.at(contest.surface()), row);
    for (const std::string& stem : {std::string("rms"), "parameters." + contest.model, "slices." + contest.table}) {
      if (drawn.insert(stem).second) figures.add(stem, row.figures);
    }
    report.rows.push_back(std::move(row));
  }
  figures.add_remark(report.remarks);
  return report;
}

}  // namespace lobefit
