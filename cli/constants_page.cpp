#include "cli/constants_page.h"

#include <fmt/format.h>

namespace lobefit {

namespace {

std::string number(const Json& value) { return value.is_number() ? fmt::format("{:.6g}", value.get<double>()) : "–"; }

std::string refitted(const Json& parameter) {
  std::string text = number(parameter.at("value"));
  if (!parameter.value("identifiable", true)) return text + ", undecided";
  if (parameter.value("at_bound", false)) return text + ", at its bound";
  if (parameter.contains("ci95") && parameter["ci95"].is_array() && parameter["ci95"][0].is_number()) {
    text += fmt::format(" [{:.5g}, {:.5g}]", parameter["ci95"][0].get<double>(), parameter["ci95"][1].get<double>());
  }
  return text;
}

/// Where a row's target stands: "fresnel_conductor, eta = 0.965, k = 6.4".
std::string reference_text(const Json& reference) {
  std::string text = reference.at("name").get<std::string>();
  for (const auto& [key, value] : reference.items()) {
    if (key != "name") text += ", " + key + " = " + (value.is_string() ? value.get<std::string>() : number(value));
  }
  return text;
}

std::string error_text(const Json& errors, const char* which, bool relative) {
  if (!errors.contains(which) || !errors[which].is_number()) return "–";
  const double error = errors[which].get<double>();
  return relative ? fmt::format("{:.3g} %", 100.0 * error) : fmt::format("{:.3g}", error);
}

std::string optimal_by(const Json& row) {
  if (!row.contains("readings") || row["readings"].empty()) return "–";
  const auto text = [](const Json& reading) {
    const std::string domain = reading.at("domain").get<std::string>();
    return reading.at("norm").get<std::string>() + " " + reading.at("metric").get<std::string>() +
           (domain.empty() ? "" : ", " + domain);
  };
  std::string found;
  for (const Json& reading : row["readings"]) {
    if (reading.at("meets_published").get<bool>()) found += (found.empty() ? "" : "; ") + text(reading);
  }
  if (!found.empty()) return found;
  return fmt::format("none; nearest, {:.2g} % off: {}", 100.0 * row["readings"][0].at("distance").get<double>(),
                     text(row["readings"][0]));
}

std::string recipe_section(const RecipeOutcome& outcome) {
  const Json& result = outcome.result;
  std::string text = fmt::format("## {}\n\n{} [All of it]({}/result.md).\n\n", outcome.recipe,
                                 result.value("conclusion", std::string()), outcome.folder.string());
  text +=
      "| row | target | constant | published | refit, 95 % | rms published | rms refit | max published | max refit | "
      "published is optimal by |\n|---|---|---|---|---|---|---|---|---|---|\n";
  for (const Json& row : result.at("rows")) {
    if (row.value("method", std::string()) == "monte_carlo") continue;
    const Json published = row.contains("published") ? row["published"] : result.value("published", Json::object());
    const bool relative = row.at("domain").value("metric", std::string()) == "relative";
    const Json largest = row.value("max", Json::object());
    bool first = true;
    for (const Json& name : row.at("free")) {
      const std::string constant = name.get<std::string>();
      text += fmt::format("| {} | {} | {} | {} | {} |", first ? row.at("name").get<std::string>() : "",
                          first ? reference_text(row.at("reference")) : "", constant,
                          published.contains(constant) ? number(published[constant]) : "–",
                          refitted(row.at("params").at(constant)));
      const bool has_published = !published.empty();
      if (first) {
        text += fmt::format(" {} | {} | {} | {} | {} |\n",
                            has_published ? error_text(row.at("rms"), "published", relative) : "–",
                            error_text(row.at("rms"), "refit", relative),
                            has_published ? error_text(largest, "published", relative) : "–",
                            error_text(largest, "refit", relative), optimal_by(row));
      } else {
        text += " | | | | |\n";
      }
      first = false;
    }
  }
  return text + "\n";
}

}  // namespace

std::string constants_page(const std::vector<RecipeOutcome>& outcomes, const std::string& command) {
  std::string page =
      "# Constants, published and refitted\n\nMade by `" + command +
      "`, lobefit " LOBEFIT_VERSION
      ".\n\nErrors are in each row's own metric over its own domain: relative ones in per cent. Intervals of closed "
      "forms against exact functions are by a jackknife over blocks of the domain: how far a constant would move with "
      "it; those of models against references, by the reference's Monte Carlo error, where it has one. *Optimal by* "
      "names every norm, metric and domain tried whose optimum is the published constants to all the digits they are "
      "printed with.\n\n";
  for (const RecipeOutcome& outcome : outcomes) {
    const Json& rows = outcome.result.value("rows", Json::array());
    const bool has_constants =
        !rows.empty() && rows[0].contains("free") && rows[0].contains("params") && rows[0].contains("name");
    if (has_constants) {
      page += recipe_section(outcome);
    } else {
      page += fmt::format("## {}\n\n{} [Its page]({}/result.md).\n\n", outcome.recipe,
                          outcome.result.value("conclusion", std::string()), outcome.folder.string());
    }
  }
  return page;
}

}  // namespace lobefit
