#include "cli/fit_batch.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <iostream>
#include <numeric>

#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "reference/quiet_monitor.h"
#include "report/material_figure.h"

namespace lobefit {

namespace {

struct Outcome {
  std::string name, failure;
  Json document;  // null if it failed
  bool kept = false;
};

/// The fit that an earlier run of the same command left of the same file; null if there is none.
Json earlier(const std::filesystem::path& path, const FitSource& source, const Context& context) {
  if (!std::filesystem::exists(path)) return nullptr;
  try {
    const Json json = parse_json(read_file(path), path.string());
    const Json& provenance = json.at("provenance");
    if (provenance.at("command") == context.command && provenance.at("seed") == context.seed &&
        provenance.at("version") == LOBEFIT_VERSION && provenance.at("table_sha256") == sha256_of_file(source.path)) {
      return json;
    }
  } catch (const std::exception&) {  // not one of ours
  }
  return nullptr;
}

void write_file(const std::filesystem::path& path, const std::string& text) {
  OutputFile file(path, true);
  file.write(text);
  file.commit();
}

double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  const double position = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return std::lerp(values[below], values[above], position - static_cast<double>(below));
}

/// Values of a metric over the fits that were made.
std::vector<double> metric_of(const std::vector<Outcome>& outcomes, const char* part, const std::string& metric) {
  std::vector<double> values;
  for (const Outcome& outcome : outcomes) {
    if (!outcome.document.is_null() && outcome.document.at(part).contains(metric))
      values.push_back(outcome.document.at(part).at(metric));
  }
  return values;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string summary_csv(const std::vector<Outcome>& outcomes) {
  const auto first = std::ranges::find_if(outcomes, [](const Outcome& o) { return !o.document.is_null(); });
  std::string text = "material,status";
  std::vector<std::string> names;
  if (first != outcomes.end()) {
    for (const char* part : {"metrics", "holdout"}) {
      for (const auto& [metric, value] : first->document.at(part).items())
        text += fmt::format(",{}{}", std::string_view(part) == "holdout" ? "held_out_" : "rms_", metric);
    }
    // A colour that is grey in one material is not in another: three columns for all.
    const ParameterValues values = find_model(first->document.at("model").get<std::string>()).defaults();
    for (const ParameterInfo& info : values.list()) {
      if (info.file) continue;
      for (int c = 0; c < info.components; ++c)
        names.push_back(std::string(info.name) +
                        (info.components == 3 ? std::array{".r", ".g", ".b"}[static_cast<std::size_t>(c)] : ""));
    }
  }
  for (const std::string& name : names) text += "," + name;
  text += ",at_bound,not_identifiable,message\n";
  for (const Outcome& outcome : outcomes) {
    text += csv_field(outcome.name);
    if (outcome.document.is_null()) {
      text += ",failed";
      if (first != outcomes.end())
        text += std::string(first->document.at("metrics").size() + first->document.at("holdout").size(), ',');
      text += std::string(names.size(), ',') + ",,," + csv_field(outcome.failure) + "\n";
      continue;
    }
    text += outcome.document.at("solver").at("converged") == true ? ",converged" : ",not converged";
    for (const char* part : {"metrics", "holdout"}) {
      for (const auto& [metric, value] : outcome.document.at(part).items())
        text += fmt::format(",{:.9g}", value.get<double>());
    }
    std::map<std::string, double> values;
    std::string at_bound, open;
    for (const Json& p : outcome.document.at("params")) {
      values[p.at("name")] = p.at("value");
      if (p.at("free") == false) continue;
      if (p.at("identifiable") == false)
        open += (open.empty() ? "" : " ") + p.at("name").get<std::string>();
      else if (p.at("at_bound") == true)
        at_bound += (at_bound.empty() ? "" : " ") + p.at("name").get<std::string>();
    }
    for (const std::string& name : names) {
      auto value = values.find(name);
      if (value == values.end()) value = values.find(name.substr(0, name.find('.')));
      text += value == values.end() ? "," : fmt::format(",{:.9g}", value->second);
    }
    text += "," + at_bound + "," + open + ",\n";
  }
  return text;
}

std::string summary_markdown(const FitJobSettings& settings, const std::vector<Outcome>& outcomes) {
  std::string text = fmt::format("# {} fitted to {} materials\n\n", settings.model->info->name, outcomes.size());
  const std::vector<double> scores = metric_of(outcomes, "metrics", settings.metric);
  if (!scores.empty()) {
    text += fmt::format("rms {}: median {:.5f}, 95th percentile {:.5f}, worst {:.5f}\n\n", settings.metric,
                        quantile(scores, 0.5), quantile(scores, 0.95), quantile(scores, 1.0));
  }
  text += fmt::format("| material | rms {} | rms cosine | at a bound | not identifiable |\n|---|---|---|---|---|\n",
                      settings.metric);
  std::vector<std::size_t> order(outcomes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto score = [&](std::size_t k) {
    const Json& document = outcomes[k].document;
    return document.is_null() ? 1e300 : document.at("metrics").at(settings.metric).get<double>();
  };
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return score(a) > score(b); });
  for (const std::size_t k : order) {
    const Outcome& outcome = outcomes[k];
    if (outcome.document.is_null()) {
      text += fmt::format("| {} | failed: {} | | | |\n", outcome.name, outcome.failure);
      continue;
    }
    int bound = 0, open = 0;
    for (const Json& p : outcome.document.at("params")) {
      if (p.at("free") == false) continue;
      const bool identifiable = p.at("identifiable");
      open += !identifiable;
      bound += identifiable && p.at("at_bound") == true;
    }
    const Json& metrics = outcome.document.at("metrics");
    text += fmt::format("| {} | {:.5f} | {:.5f} | {} | {} |\n", outcome.name, metrics.at(settings.metric).get<double>(),
                        metrics.at("cosine").get<double>(), bound, open);
  }
  return text;
}

Json summary_json(const FitJobSettings& settings, const std::vector<Outcome>& outcomes, const Context& context) {
  Json fits = Json::array(), failures = Json::array();
  for (const Outcome& outcome : outcomes) {
    if (outcome.document.is_null()) {
      failures.push_back({{"material", outcome.name}, {"message", outcome.failure}});
      continue;
    }
    const Json& d = outcome.document;
    fits.push_back({{"material", outcome.name},
                    {"fit", outcome.name + ".fit.json"},
                    {"converged", d.at("solver").at("converged")},
                    {"identifiable", d.at("identifiable")},
                    {"metrics", d.at("metrics")},
                    {"holdout", d.at("holdout")}});
    if (d.contains("tiers")) fits.back()["tiers"] = d.at("tiers");
  }
  Json quantiles = Json::object();
  for (const std::string_view name : quantity_names) {
    const std::vector<double> values = metric_of(outcomes, "metrics", std::string(name));
    if (values.empty()) continue;
    quantiles[std::string(name)] = {
        {"median", quantile(values, 0.5)}, {"p95", quantile(values, 0.95)}, {"worst", quantile(values, 1.0)}};
  }
  return {{"model", settings.model->info->name},
          {"materials", outcomes.size()},
          {"quantiles", quantiles},
          {"fits", fits},
          {"failures", failures},
          {"provenance", {{"version", LOBEFIT_VERSION}, {"command", context.command}, {"seed", context.seed}}}};
}

void check_names(const std::vector<FitSource>& sources, const std::filesystem::path& folder, bool resume,
                 const Context& context) {
  std::map<std::string, std::string> paths;
  for (const FitSource& source : sources) {
    const auto [place, fresh] = paths.emplace(source.name(), source.path);
    if (!fresh) {
      throw Error(ExitCode::usage, "two materials are called '" + source.name() + "'",
                  place->second + ", " + source.path, "rename one, or fit them into two folders");
    }
    const std::filesystem::path path = folder / (source.name() + ".fit.json");
    if (!context.force && !resume && std::filesystem::exists(path)) {
      throw Error(ExitCode::usage, "the fit exists already", path.string(),
                  "go on with --resume, start over with --force, or choose another folder");
    }
  }
}

}  // namespace

void run_fit_batch(const FitJobSettings& settings, const std::vector<FitSource>& sources,
                   const std::filesystem::path& folder, bool resume, const Context& context) {
  check_names(sources, folder, resume, context);
  std::error_code code;
  std::filesystem::create_directories(folder, code);
  if (code) throw Error(ExitCode::failure, code.message(), folder.string(), "choose a folder that can be written");

  const auto monitor = context.monitor();
  monitor->begin(fmt::format("fit {} to {} materials", settings.model->info->name, sources.size()), sources.size());
  std::vector<Outcome> outcomes(sources.size());
  tbb::parallel_for(std::size_t{0}, sources.size(), [&](std::size_t k) {
    const FitSource& source = sources[k];
    Outcome& outcome = outcomes[k];
    outcome.name = source.name();
    const std::filesystem::path path = folder / (outcome.name + ".fit.json");
    if (resume) outcome.document = earlier(path, source, context);
    outcome.kept = !outcome.document.is_null();
    if (!outcome.kept) {
      QuietMonitor quiet(*monitor);
      quiet.check();
      try {
        FitJob job = run_fit(settings, source, context, quiet);
        write_file(path, job.document.dump(2) + "\n");
        if (settings.figure) write_figure(job.figure, folder / (outcome.name + ".svg"), true, material_figure_size());
        outcome.document = std::move(job.document);
      } catch (const Error& error) {
        if (error.code() == ExitCode::interrupted || error.code() == ExitCode::failure) throw;
        outcome.failure = error.what();
      }
    }
    monitor->advance(1);
  });
  monitor->end();

  const Json summary = summary_json(settings, outcomes, context);
  const std::string table = summary_markdown(settings, outcomes);
  write_file(folder / "summary.json", summary.dump(2) + "\n");
  write_file(folder / "summary.csv", summary_csv(outcomes));
  write_file(folder / "summary.md", table);
  if (context.json)
    std::cout << summary.dump(2) << "\n";
  else
    fmt::print("{}", table);
  const auto kept = std::ranges::count_if(outcomes, &Outcome::kept);
  if (kept > 0) context.say(fmt::format("{} fits were there already and kept", kept));
  context.say(fmt::format("see {}", (folder / "summary.md").string()));
  if (summary.at("fits").empty())
    throw Error(ExitCode::invalid_input, "no material could be fitted", folder.string(), outcomes.front().failure);
  for (const Json& fit : summary.at("fits")) {
    if (fit.at("converged") == false) {
      throw Error(ExitCode::not_converged, "a fit did not converge", fit.at("material").get<std::string>(),
                  "try --starts 16, or free fewer parameters");
    }
  }
}

}  // namespace lobefit
