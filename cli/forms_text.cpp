#include "cli/forms_text.h"

#include <fmt/format.h>

#include <algorithm>

namespace lobefit {

namespace {

std::string reading_text(const JsonReader& reading) {
  const std::string domain = reading.at("domain").text();
  return reading.at("norm").text() + ", " + reading.at("metric").text() + (domain.empty() ? "" : ", " + domain);
}

/// The argument that each line of a row has its own value of, and that value; empty where the row has one line.
std::string each_text(const JsonReader& line, const char* separator, const char* equals) {
  if (!line.has("each")) return "";
  const std::string each = line.at("each").text();
  return fmt::format("{}{}{}{:g}", separator, each, equals, line.at("reference").at(each).number());
}

}  // namespace

std::string form_line_title(const JsonReader& line) { return line.at("name").text() + each_text(line, ", ", " = "); }

std::string form_line_stem(const JsonReader& line) { return line.at("name").text() + each_text(line, ".", "_"); }

std::string form_constant_text(const JsonReader& constant) {
  const double value = constant.at("value").number();
  if (!constant.has("ci95")) return fmt::format("({:.6g})", value);
  if (!constant.at("identifiable").boolean()) return fmt::format("{:.6g}, undecided", value);
  if (constant.at("at_bound").boolean()) return fmt::format("{:.6g}, at its bound", value);
  const std::vector<double> interval = constant.at("ci95").numbers();
  if (interval.size() != 2) throw constant.at("ci95").error("expected two numbers", "write [low, high]");
  return fmt::format("{:.6g} [{:.5g}, {:.5g}]", value, interval[0], interval[1]);
}

std::string form_error_text(const JsonReader& line, std::string_view norm, std::string_view which) {
  const double error = line.at(norm).at(which).number();
  const bool relative = line.at("domain").at("metric").text() == "relative";
  return relative ? fmt::format("{:.3g} %", 100.0 * error) : fmt::format("{:.3g}", error);
}

std::string form_verdict(const JsonReader& line) {
  const std::vector<JsonReader> readings = line.at("readings").elements();
  if (readings.empty()) return "";
  std::string found;
  for (const JsonReader& reading : readings) {
    if (reading.at("meets_published").boolean()) found += (found.empty() ? "" : "; ") + reading_text(reading);
  }
  if (!found.empty()) return "to all their digits: " + found;
  return fmt::format("none; nearest ({:.2g} % off): {}", 100.0 * readings.front().at("distance").number(),
                     reading_text(readings.front()));
}

std::string form_domain_text(const JsonReader& line) {
  std::string axes;
  for (const auto& [name, axis] : line.at("domain").members()) {
    if (!axis.value().is_object()) continue;  // metric and norm
    const bool degrees = axis.has("degrees");
    const std::vector<double> values = axis.at(degrees ? "degrees" : "values").numbers();
    axes += fmt::format("{}{} {:g} … {:g}{} ({})", axes.empty() ? "" : ", ", name, std::ranges::min(values),
                        std::ranges::max(values), degrees ? "°" : "", values.size());
  }
  return axes;
}

}  // namespace lobefit
