// The page of a refit of closed forms: constants, errors and the readings under which published constants are optimal.
#include <fmt/format.h>

#include "cli/forms_text.h"
#include "cli/report_folder.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

HtmlTable constants_table(const std::vector<JsonReader>& lines) {
  HtmlTable table{.caption = "Constants", .header = {"row", "form", "constant", "published", "refit"}};
  for (const JsonReader& line : lines) {
    for (const auto& [name, constant] : line.at("params").members()) {
      const JsonReader published = line.at("published");
      table.lines.push_back({form_line_title(line), line.at("formula").text(), name,
                             published.has(name) ? fmt::format("{:.7g}", published.at(name).number()) : "–",
                             form_constant_text(constant)});
    }
  }
  table.note =
      "Targets are exact. Intervals are 95 % by a jackknife over blocks of the domain: how far a constant would move "
      "with the domain. Constants in parentheses were held.";
  return table;
}

HtmlTable errors_table(const std::vector<JsonReader>& lines) {
  HtmlTable table{.caption = "Errors",
                  .header = {"row", "error", "rms published", "rms refit", "max published", "max refit",
                             "published is optimal by"}};
  for (const JsonReader& line : lines) {
    const bool compared = !line.at("published").value().empty();
    const auto text = [&](const char* norm, const char* which) { return form_error_text(line, norm, which); };
    const std::string verdict = form_verdict(line);
    table.lines.push_back({form_line_title(line), line.at("domain").at("metric").text(),
                           compared ? text("rms", "published") : "–", text("rms", "refit"),
                           compared ? text("max", "published") : "–", text("max", "refit"),
                           verdict.empty() ? "–" : verdict});
  }
  table.note = "Errors over each row's domain.";
  return table;
}

std::string domain_text(const JsonReader& line) {
  return line.at("formula").text() + " for " + line.at("reference").at("name").text() + ", over " +
         form_domain_text(line) + "; fitted for the least " + line.at("domain").at("norm").text() + " " +
         line.at("domain").at("metric").text() + " error.";
}

}  // namespace

HtmlReport forms_report(const fs::path& folder, const JsonReader& result) {
  HtmlReport report = report_head(result);
  const std::vector<JsonReader> lines = result.at("rows").elements();
  report.tables = {constants_table(lines), errors_table(lines)};
  FolderFigures figures(folder);
  std::string drawn;
  for (const JsonReader& line : lines) {
    HtmlRow row{.name = form_line_title(line), .note = domain_text(line)};
    row.shaders = folder_shaders(folder, form_line_stem(line));
    // A figure shows the first of a row's lines.
    const std::string name = line.at("name").text();
    if (std::exchange(drawn, name) != name) figures.add(name, row.figures);
    report.rows.push_back(std::move(row));
  }
  figures.add_remark(report.remarks);
  return report;
}

}  // namespace lobefit
