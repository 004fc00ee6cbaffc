// The page of a refit of closed forms: constants, errors and the readings under which published constants are optimal.
#include <fmt/format.h>

#include <algorithm>

#include "cli/report_folder.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

/// "longitudinal, width = 0.5"
std::string line_title(const JsonReader& line) {
  const std::string name = line.at("name").text();
  if (!line.has("each")) return name;
  const std::string each = line.at("each").text();
  return fmt::format("{}, {} = {:g}", name, each, line.at("reference").at(each).number());
}

std::string file_stem(const JsonReader& line) {
  const std::string name = line.at("name").text();
  if (!line.has("each")) return name;
  const std::string each = line.at("each").text();
  return fmt::format("{}.{}_{:g}", name, each, line.at("reference").at(each).number());
}

std::string constant_text(const JsonReader& constant) {
  const double value = constant.at("value").number();
  if (!constant.has("ci95")) return fmt::format("({:.6g})", value);
  if (!constant.at("identifiable").boolean()) return fmt::format("{:.6g}, undecided", value);
  if (constant.at("at_bound").boolean()) return fmt::format("{:.6g}, at its bound", value);
  const std::vector<double> interval = constant.at("ci95").numbers();
  if (interval.size() != 2) throw constant.at("ci95").error("expected two numbers", "write [low, high]");
  return fmt::format("{:.6g} [{:.5g}, {:.5g}]", value, interval[0], interval[1]);
}

HtmlTable constants_table(const std::vector<JsonReader>& lines) {
  HtmlTable table{.caption = "Constants", .header = {"row", "form", "constant", "published", "refit"}};
  for (const JsonReader& line : lines) {
    for (const auto& [name, constant] : line.at("params").members()) {
      const JsonReader published = line.at("published");
      table.lines.push_back({line_title(line), line.at("formula").text(), name,
                             published.has(name) ? fmt::format("{:.7g}", published.at(name).number()) : "–",
                             constant_text(constant)});
    }
  }
  table.note =
      "Targets are exact. Intervals are 95 % by a jackknife over blocks of the domain: how far a constant would move "
      "with the domain. Constants in parentheses were held.";
  return table;
}

std::string reading_text(const JsonReader& reading) {
  const std::string domain = reading.at("domain").text();
  return reading.at("norm").text() + ", " + reading.at("metric").text() + (domain.empty() ? "" : ", " + domain);
}

/// By what the published constants are optimal, as the recipe's readings go.
std::string verdict(const JsonReader& line) {
  const std::vector<JsonReader> readings = line.at("readings").elements();
  if (readings.empty()) return "–";
  std::string found;
  for (const JsonReader& reading : readings) {
    if (reading.at("meets_published").boolean()) found += (found.empty() ? "" : "; ") + reading_text(reading);
  }
  if (!found.empty()) return "to all their digits: " + found;
  return fmt::format("none; nearest ({:.2g} % off): {}", 100.0 * readings.front().at("distance").number(),
                     reading_text(readings.front()));
}

HtmlTable errors_table(const std::vector<JsonReader>& lines) {
  HtmlTable table{.caption = "Errors",
                  .header = {"row", "error", "rms published", "rms refit", "max published", "max refit",
                             "published is optimal by"}};
  for (const JsonReader& line : lines) {
    const bool relative = line.at("domain").at("metric").text() == "relative";
    const bool compared = !line.at("published").value().empty();
    const auto text = [&](const char* norm, const char* which) {
      const double error = line.at(norm).at(which).number();
      return relative ? fmt::format("{:.3g} %", 100.0 * error) : fmt::format("{:.3g}", error);
    };
    table.lines.push_back({line_title(line), line.at("domain").at("metric").text(),
                           compared ? text("rms", "published") : "–", text("rms", "refit"),
                           compared ? text("max", "published") : "–", text("max", "refit"), verdict(line)});
  }
  table.note = "Errors over each row's domain.";
  return table;
}

std::string domain_text(const JsonReader& line) {
  std::string text = line.at("formula").text() + " for " + line.at("reference").at("name").text() + ", over ";
  std::string axes;
  for (const auto& [name, axis] : line.at("domain").members()) {
    if (!axis.value().is_object()) continue;
    const bool degrees = axis.has("degrees");
    const std::vector<double> values = axis.at(degrees ? "degrees" : "values").numbers();
    axes += fmt::format("{}{} {:g} … {:g}{} ({})", axes.empty() ? "" : ", ", name, std::ranges::min(values),
                        std::ranges::max(values), degrees ? "°" : "", values.size());
  }
  return text + axes + "; fitted for the least " + line.at("domain").at("norm").text() + " " +
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
    HtmlRow row{.name = line_title(line), .note = domain_text(line)};
    row.shaders = folder_shaders(folder, file_stem(line));
    // A figure shows the first of a row's lines.
    const std::string name = line.at("name").text();
    if (std::exchange(drawn, name) != name) figures.add(name, row.figures);
    report.rows.push_back(std::move(row));
  }
  figures.add_remark(report.remarks);
  return report;
}

}  // namespace lobefit
