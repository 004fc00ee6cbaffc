#include "report/html_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

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

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&': result += "&amp;"; break;
      case '<': result += "&lt;"; break;
      case '>': result += "&gt;"; break;
      case '"': result += "&quot;"; break;
      default: result += c;
    }
  }
  return result;
}

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

std::string row_html(const HtmlRow& row, std::size_t number) {
  const std::string id = fmt::format("row-{}", number);
  std::string html = fmt::format("<article class=\"row\" id=\"{0}\" aria-labelledby=\"{0}-title\">\n", id);
  html += "<h3 id=\"" + id + "-title\">" + escaped(row.name) + "</h3>\n";
  if (!row.note.empty()) html += "<p class=\"note row-note\">" + escaped(row.note) + "</p>\n";
  for (const HtmlTable& table : row.tables) html += table_html(table, "h4");
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

/// Arrays of the page, each once; and which parameter rows of each table are kept.
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

  Json slices(const HtmlSlices& slices) {
    const Table& table = *slices.reference;
    if (table.coordinates != Coordinates::spherical) {
      throw Error(ExitCode::usage, "slices need a table over polar angles", slices.label,
                  "resample the table on a grid first");
    }
    const std::vector<std::size_t> rows = kept_rows(table);
    std::vector<float> reference = of_rows(table, table.values, rows);
    for (std::size_t k = 0; k < reference.size(); ++k) {
      if (!table.valid[entry_of(table, rows, k)]) reference[k] = std::nanf("");
    }
    Json labels = Json::array(), lines = Json::array();
    for (const std::size_t row : rows) labels.push_back(row_label(table, row));
    const std::size_t packed = add(reference);
    for (const HtmlLine& line : slices.lines) {
      std::vector<float> difference = of_rows(table, line.values, rows);
      for (std::size_t k = 0; k < difference.size(); ++k) difference[k] -= reference[k];
      lines.push_back({{"label", line.label}, {"difference", add(difference)}});
    }
    return {{"theta_i", table.grid.theta_i.values},
            {"theta_o", table.grid.theta_o.values},
            {"phi", table.grid.phi.values},
            {"rows", labels},
            {"channels", table.channels},
            {"quantity", quantity_names[static_cast<std::size_t>(slices.quantity)]},
            {"label", slices.label},
            {"reference", packed},
            {"lines", lines}};
  }

 private:
  static std::size_t bytes_of(const Table& table) { return table.values.size() * 8 / 3; }

  /// Evenly spread, both ends included.
  std::vector<std::size_t> kept_rows(const Table& table) {
    const std::size_t all = table.parameter_rows();
    const double share = bytes_of(table) <= small_array_bytes ? 1.0 : share_;
    const auto kept =
        std::clamp(static_cast<std::size_t>(share * static_cast<double>(all)), std::min<std::size_t>(all, 2), all);
    left_out_ = left_out_ || kept < all;
    std::vector<std::size_t> rows;
    for (std::size_t k = 0; k < kept; ++k) rows.push_back(kept == 1 ? 0 : k * (all - 1) / (kept - 1));
    return rows;
  }

  static std::size_t entry_of(const Table& table, const std::vector<std::size_t>& rows, std::size_t k) {
    const std::size_t per_row = table.entries() / table.parameter_rows(), at = k % (rows.size() * per_row);
    return rows[at / per_row] * per_row + at % per_row;
  }

  /// [channel][row][theta_o][theta_i][phi] of the rows kept.
  static std::vector<float> of_rows(const Table& table, const std::vector<float>& values,
                                    const std::vector<std::size_t>& rows) {
    const std::size_t per_channel = rows.size() * table.entries() / table.parameter_rows();
    std::vector<float> result(per_channel * static_cast<std::size_t>(table.channels));
    for (std::size_t k = 0; k < result.size(); ++k)
      result[k] = values[k / per_channel * table.entries() + entry_of(table, rows, k)];
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

Json explorer_json(const HtmlExplorer& explorer) {
  const auto flat_json = [](const ParameterInfo& info, const std::vector<double>& flat) {
    const auto first = flat.begin() + info.offset;
    return Json(std::vector<double>(first, first + info.components));
  };
  Json parameters = Json::array();
  for (const ParameterInfo& info : explorer.model->parameters) {
    if (info.components == 0) continue;
    Json values = Json::array();
    for (const auto& [label, flat] : explorer.spheres) values.push_back(flat_json(info, flat));
    const bool apart = std::ranges::find(explorer.fitted, info.name) != explorer.fitted.end() ||
                       std::ranges::any_of(values, [&](const Json& value) { return value != values.front(); });
    parameters.push_back({{"name", info.name},
                          {"symbol", info.symbol},
                          {"unit", info.unit},
                          {"doc", info.doc},
                          {"lower", info.lower},
                          {"upper", info.upper},
                          {"choices", std::vector<std::string>(info.choices.begin(), info.choices.end())},
                          {"apart", apart},
                          {"values", values}});
  }
  Json labels = Json::array();
  for (const auto& [label, flat] : explorer.spheres) labels.push_back(label);
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
  for (std::size_t k = 0; k < report.rows.size(); ++k) {
    const HtmlRow& row = report.rows[k];
    row_texts += row_html(row, k);
    rows.push_back({{"name", row.name},
                    {"note", row.note},
                    {"slices", row.slices.reference ? packed.slices(row.slices) : Json()},
                    {"explorer", row.explorer.model ? explorer_json(row.explorer) : Json()}});
  }
  if (packed.leaves_out()) {
    report.remarks.push_back(
        "To keep the page small, slices and residuals show some of the tables' parameter rows, evenly spread; the "
        "tables hold them all.");
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
