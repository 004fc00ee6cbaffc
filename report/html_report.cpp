#include "report/html_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "report/html_chart.h"
#include "report/html_page.h"
#include "report/html_values.h"

namespace lobefit {

namespace {

/// Bytes of packed values on a page, all tables together.
constexpr std::size_t most_value_bytes = 2'000'000;
/// Of one array: tables below that keep all of their parameter rows.
constexpr std::size_t small_array_bytes = 20'000;

/// A conclusion of more bytes would push everything else off the first screen.
constexpr std::size_t longest_open_conclusion = 1000;

/// JSON that can stand in a script element: no text in it can end the element or open a comment.
std::string script_json(const Json& json) {
  std::string result;
  for (const char c : json.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    if (c == '<') {
      result += "\\u003c";
    } else {
      result += c;
    }
  }
  return result;
}

/// `page` with every {{name}} replaced; what is put in is not read again.
std::string filled(std::string_view page, const std::map<std::string, std::string, std::less<>>& values) {
  std::string result;
  for (std::size_t at = 0; at < page.size();) {
    const std::size_t open = std::min(page.find("{{", at), page.size());
    result += page.substr(at, open - at);
    if (open == page.size()) break;
    const std::size_t close = page.find("}}", open);
    result += values.find(page.substr(open + 2, close - open - 2))->second;
    at = close + 2;
  }
  return result;
}

std::string table_html(const HtmlTable& table, const char* heading) {
  std::string html = fmt::format("<section class=\"wide\"><{0}>{1}</{0}>", heading, escaped(table.caption)) +
                     "\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"" + escaped(table.caption) +
                     "\"><table>\n<thead><tr>";
  for (const std::string& cell : table.header) html += "<th scope=\"col\">" + escaped(cell) + "</th>";
  html += "</tr></thead>\n<tbody>\n";
  for (const std::vector<std::string>& line : table.lines) {
    html += "<tr>";
    for (std::size_t k = 0; k < line.size(); ++k) {
      html += k == 0 ? "<th scope=\"row\">" + escaped(line[k]) + "</th>" : "<td>" + escaped(line[k]) + "</td>";
    }
    html += "</tr>\n";
  }
  html += "</tbody></table></div>\n";
  if (!table.note.empty()) html += "<p class=\"note\">" + escaped(table.note) + "</p>\n";
  return html + "</section>\n";
}

/// An SVG's text stays text: smaller than base64.
std::string svg_address(std::string_view svg) {
  constexpr std::string_view apart = "\"#%<>&{}|\\^`";
  std::string address = "data:image/svg+xml,";
  for (const char c : svg) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte <= 0x20) {
      address += c == ' ' ? "%20" : fmt::format("%{:02X}", byte);
    } else if (byte >= 0x7f || apart.find(c) != std::string_view::npos) {
      address += fmt::format("%{:02X}", byte);
    } else {
      address += c;
    }
  }
  return address;
}

std::string figure_html(const HtmlFigure& figure) {
  const std::string address = figure.media_type == "image/svg+xml"
                                  ? svg_address(figure.content)
                                  : "data:" + figure.media_type + ";base64," + base64(figure.content);
  return "<figure class=\"picture\"><img alt=\"" + escaped(figure.title) + "\" src=\"" + address + "\"><figcaption>" +
         escaped(figure.title) + "</figcaption></figure>\n";
}

std::string charts_html(const std::vector<HtmlChart>& charts) {
  std::string html;
  for (const HtmlChart& chart : charts) html += chart_html(chart);
  return html.empty() ? "" : "<div class=\"charts\">\n" + html + "</div>\n";
}

std::string row_html(const HtmlRow& row, std::size_t number) {
  const std::string id = fmt::format("row-{}", number);
  std::string html = fmt::format("<article class=\"row\" id=\"{0}\" aria-labelledby=\"{0}-title\">\n", id);
  html += "<h3 id=\"" + id + "-title\">" + escaped(row.name) + "</h3>\n";
  if (!row.note.empty()) html += "<p class=\"note row-note\">" + escaped(row.note) + "</p>\n";
  for (const HtmlTable& table : row.tables) html += table_html(table, "h4");
  html += charts_html(row.charts);
  for (const HtmlMatrix& matrix : row.matrices) html += matrix_html(matrix);
  if (!row.shaders.empty()) {
    html += "<section class=\"shaders\"><h4>Shader</h4>\n";
    for (const HtmlShader& shader : row.shaders) {
      html += "<section class=\"shader\" data-language=\"" + escaped(shader.language) + "\"><h5>" +
              escaped(shader.language) + "</h5><pre tabindex=\"0\"><code>" + escaped(shader.text) +
              "</code></pre></section>\n";
    }
    html += "</section>\n";
  }
  if (!row.figures.empty()) {
    html += "<section class=\"figures\"><h4>Figures</h4>\n";
    for (const HtmlFigure& figure : row.figures) html += figure_html(figure);
    html += "</section>\n";
  }
  return html + "</article>\n";
}

std::string row_label(const Table& table, std::size_t row) {
  std::string label;
  const std::vector<double> values = table.parameter_values(row);
  for (std::size_t k = 0; k < values.size(); ++k)
    label += fmt::format("{}{} {:g}", label.empty() ? "" : ", ", table.parameter_axes[k].name, values[k]);
  return label;
}

/// Which parameter rows and angles of a table are kept.
struct KeptEntries {
  std::vector<std::size_t> rows, theta_o, theta_i, phi;

  std::size_t count() const { return rows.size() * theta_o.size() * theta_i.size() * phi.size(); }
  /// The table's entry at place k of [row][theta_o][theta_i][phi].
  std::size_t entry(const Table& table, std::size_t k) const {
    const std::size_t p = k % phi.size(), i = k / phi.size() % theta_i.size(),
                      o = k / phi.size() / theta_i.size() % theta_o.size(),
                      row = k / phi.size() / theta_i.size() / theta_o.size();
    return (rows[row] * table.lines_per_parameter() + theta_o[o]) * table.width() + theta_i[i] * table.grid.phi.size() +
           phi[p];
  }
};

/// Every stride-th of n, and the last.
std::vector<std::size_t> strided(std::size_t n, std::size_t stride) {
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < n; k += stride) kept.push_back(k);
  if (kept.back() != n - 1) kept.push_back(n - 1);
  return kept;
}

/// About a share of the table's entries: parameter rows evenly spread, both ends included; where two are still too
/// many, angles too.
KeptEntries kept_entries(const Table& table, double share) {
  const std::size_t all = table.parameter_rows();
  const auto count =
      std::clamp(static_cast<std::size_t>(share * static_cast<double>(all)), std::min<std::size_t>(all, 2), all);
  KeptEntries kept;
  for (std::size_t k = 0; k < count; ++k) kept.rows.push_back(count == 1 ? 0 : k * (all - 1) / (count - 1));
  const double most = std::max(1.25 * share, 1e-9) * static_cast<double>(table.entries());
  for (std::size_t step = 0;; ++step) {
    kept.phi = strided(table.grid.phi.size(), 1 + (step + 2) / 3);
    kept.theta_i = strided(table.grid.theta_i.size(), 1 + (step + 1) / 3);
    kept.theta_o = strided(table.grid.theta_o.size(), 1 + step / 3);
    // Two values an axis are the least.
    if (static_cast<double>(kept.count()) <= most || kept.count() <= kept.rows.size() * 8) return kept;
  }
}

std::vector<double> values_at(const std::vector<double>& values, const std::vector<std::size_t>& places) {
  std::vector<double> result;
  for (const std::size_t place : places) result.push_back(values[place]);
  return result;
}

/// Arrays of the page, each once; and what of each table is kept.
class PackedTables {
 public:
  explicit PackedTables(const std::vector<HtmlRow>& rows) {
    std::size_t bytes = 0;
    std::map<const Table*, bool> counted;
    for (const HtmlRow& row : rows) {
      if (!row.slices.reference) continue;
      const std::size_t one = bytes_of(*row.slices.reference);
      if (one <= small_array_bytes) continue;
      if (!std::exchange(counted[row.slices.reference.get()], true)) bytes += one;
      bytes += one * row.slices.lines.size();
    }
    share_ =
        std::min(1.0, static_cast<double>(most_value_bytes) / static_cast<double>(std::max<std::size_t>(bytes, 1)));
  }

  bool leaves_out() const { return left_out_; }
  const Json& arrays() const { return arrays_; }
  KeptEntries kept(const Table& table) const {
    return kept_entries(table, bytes_of(table) <= small_array_bytes ? 1.0 : share_);
  }

  Json slices(const HtmlSlices& slices) {
    const Table& table = *slices.reference;
    if (table.coordinates != Coordinates::spherical) {
      throw Error(ExitCode::usage, "slices need a table over polar angles", slices.label,
                  "resample the table on a grid first");
    }
    const KeptEntries places = kept(table);
    left_out_ = left_out_ || places.count() < table.entries();
    std::vector<float> reference = at_places(table, table.values, places);
    for (std::size_t k = 0; k < reference.size(); ++k) {
      if (!table.valid[places.entry(table, k % places.count())]) reference[k] = std::nanf("");
    }
    Json labels = Json::array(), lines = Json::array();
    for (const std::size_t row : places.rows) labels.push_back(row_label(table, row));
    const std::size_t packed = add(reference);
    for (const HtmlLine& line : slices.lines) {
      std::vector<float> difference = at_places(table, line.values, places);
      for (std::size_t k = 0; k < difference.size(); ++k) difference[k] -= reference[k];
      lines.push_back({{"label", line.label}, {"difference", add(difference)}});
    }
    return {{"theta_i", values_at(table.grid.theta_i.values, places.theta_i)},
            {"theta_o", values_at(table.grid.theta_o.values, places.theta_o)},
            {"phi", values_at(table.grid.phi.values, places.phi)},
            {"rows", labels},
            {"channels", table.channels},
            {"quantity", quantity_names[static_cast<std::size_t>(slices.quantity)]},
            {"label", slices.label},
            {"reference", packed},
            {"lines", lines}};
  }

 private:
  static std::size_t bytes_of(const Table& table) { return table.values.size() * 8 / 3; }

  /// [channel][row][theta_o][theta_i][phi] of what is kept.
  static std::vector<float> at_places(const Table& table, const std::vector<float>& values, const KeptEntries& places) {
    std::vector<float> result(places.count() * static_cast<std::size_t>(table.channels));
    for (std::size_t k = 0; k < result.size(); ++k)
      result[k] = values[k / places.count() * table.entries() + places.entry(table, k % places.count())];
    return result;
  }

  /// The array's number on the page.
  std::size_t add(const std::vector<float>& values) {
    PackedValues packed = pack_values(values);
    const auto [known, fresh] = numbers_.emplace(std::pair(packed.scale, packed.data), arrays_.size());
    if (fresh) arrays_.push_back({{"scale", packed.scale}, {"data", std::move(packed.data)}});
    return known->second;
  }

  double share_ = 1.0;
  bool left_out_ = false;
  Json arrays_ = Json::array();
  std::map<std::pair<double, std::string>, std::size_t> numbers_;
};

/// Values of parameters as [parameter row of `kept`][sphere][component].
Json explorer_json(const HtmlExplorer& explorer, const std::vector<std::size_t>& kept) {
  Json parameters = Json::array();
  for (const ParameterInfo& info : explorer.model->parameters) {
    if (info.components == 0) continue;
    bool apart = std::ranges::find(explorer.fitted, info.name) != explorer.fitted.end();
    // Fits may leave a parameter's own range where they were told to.
    double lower = info.lower, upper = info.upper;
    Json rows = Json::array();
    for (const std::size_t row : kept) {
      Json values = Json::array();
      for (const HtmlSphere& sphere : explorer.spheres) {
        const std::vector<double>& flat = sphere.rows[std::min(row, sphere.rows.size() - 1)];
        const auto first = flat.begin() + info.offset;
        const std::vector<double> components(first, first + info.components);
        lower = std::min(lower, std::ranges::min(components));
        upper = std::max(upper, std::ranges::max(components));
        values.push_back(components);
      }
      apart = apart || std::ranges::any_of(values, [&](const Json& value) { return value != values.front(); });
      rows.push_back(std::move(values));
    }
    parameters.push_back({{"name", info.name},
                          {"symbol", info.symbol},
                          {"unit", info.unit},
                          {"doc", info.doc},
                          {"lower", lower},
                          {"upper", upper},
                          {"choices", std::vector<std::string>(info.choices.begin(), info.choices.end())},
                          {"apart", apart},
                          {"values", rows}});
  }
  Json labels = Json::array();
  for (const HtmlSphere& sphere : explorer.spheres) labels.push_back(sphere.label);
  return {{"model", explorer.model->info->name}, {"spheres", labels}, {"parameters", parameters}};
}

std::string lead_html(const HtmlReport& report) {
  std::string html;
  if (!report.description.empty()) html += "<p>" + escaped(report.description) + "</p>\n";
  const std::string conclusion = "<p class=\"conclusion\">" + escaped(report.conclusion) + "</p>\n";
  if (report.conclusion.size() > longest_open_conclusion) {
    html += "<details><summary>Conclusion</summary>\n" + conclusion + "</details>\n";
  } else if (!report.conclusion.empty()) {
    html += conclusion;
  }
  if (!report.command.empty())
    html += "<p class=\"command\">Made by <code>" + escaped(report.command) + "</code></p>\n";
  return html;
}

std::string provenance_html(const HtmlReport& report) {
  std::string html = "<dl>\n";
  for (const auto& [name, value] : report.provenance)
    html += "<dt>" + escaped(name) + "</dt><dd>" + escaped(value) + "</dd>\n";
  html += "</dl>\n";
  if (report.remarks.empty()) return html;
  html += "<h3>Remarks</h3>\n<ul>\n";
  for (const std::string& remark : report.remarks) html += "<li>" + escaped(remark) + "</li>\n";
  return html + "</ul>\n";
}

}  // namespace

std::string html_report(HtmlReport report) {
  PackedTables packed(report.rows);
  Json rows = Json::array();
  std::string row_texts, tables;
  for (const HtmlTable& table : report.tables) tables += table_html(table, "h2");
  tables += charts_html(report.charts);
  for (std::size_t k = 0; k < report.rows.size(); ++k) {
    const HtmlRow& row = report.rows[k];
    row_texts += row_html(row, k);
    const Table* const table = row.slices.reference.get();
    const std::vector<std::size_t> kept = table ? packed.kept(*table).rows : std::vector<std::size_t>{0};
    rows.push_back({{"name", row.name},
                    {"note", row.note},
                    {"slices", table ? packed.slices(row.slices) : Json()},
                    {"explorer", row.explorer.model ? explorer_json(row.explorer, kept) : Json()}});
  }
  if (packed.leaves_out()) {
    report.remarks.push_back(
        "To keep the page small, slices, residuals and references show some of the tables' parameter rows and angles, "
        "evenly spread; the tables hold them all.");
  }
  return filled(html_page.text, {{"title", escaped(report.title)},
                                 {"style", std::string(html_page.style)},
                                 {"lead", lead_html(report)},
                                 {"tables", tables},
                                 {"rows-hidden", report.rows.empty() ? " hidden" : ""},
                                 {"rows", row_texts},
                                 {"provenance", provenance_html(report)},
                                 {"data", script_json({{"rows", rows}, {"arrays", packed.arrays()}})},
                                 {"script", std::string(html_page.script)}});
}

}  // namespace lobefit
