#include "cli/metrics_text.h"

#include <fmt/format.h>

#include <initializer_list>

#include "report/lighting.h"

namespace lobefit {

std::string metrics_text(const MetricsReport& report) {
  std::string text;
  const BrdfDifference& brdf = report.brdf;
  const auto line = [&](std::string_view name, std::initializer_list<std::optional<double>> values) {
    text += fmt::format("  {:<19}", name);
    for (const std::optional<double>& value : values)
      text += fmt::format(" {:<12}", value ? fmt::format("{:.5g}", *value) : "-");
    text += "\n";
  };
  const auto heading = [&](std::string_view name, std::string_view first, std::string_view second) {
    text += fmt::format("  {:<19} {:<12} {:<12}\n", name, first, second);
  };
  const auto entry_mean = [&](const std::string& name, const EntryMean& mean) {
    line(name, {mean.uniform, mean.solid_angle});
  };
  heading("", "uniform", "solid angle");
  for (std::size_t q = 0; q < quantity_names.size(); ++q) {
    entry_mean("rms " + std::string(quantity_names[q]), brdf.rms[q]);
  }
  entry_mean("mean absolute log", brdf.mean_absolute_log);
  entry_mean("smape", brdf.smape);
  if (brdf.bihemispherical) {
    heading("", "absolute", "relative");
    line("bihemispherical", {brdf.bihemispherical->absolute, brdf.bihemispherical->relative});
  }
  if (brdf.albedo) {
    heading("albedo", "worst", "mean");
    line("  absolute", {brdf.albedo->absolute.worst, brdf.albedo->absolute.mean});
    if (brdf.albedo->relative) line("  relative", {brdf.albedo->relative->worst, brdf.albedo->relative->mean});
  }
  if (!report.spheres.empty()) {
    text += fmt::format("  {:<19} {:<12} {:<12} {}\n", "spheres", "dE_ITP mean", "95 %", "FLIP");
    for (const std::string_view name : lighting_names) {
      line("  " + std::string(name),
           {report.mean(name, &ImageDifference::delta_e_itp_mean), report.mean(name, &ImageDifference::delta_e_itp_p95),
            report.mean(name, &ImageDifference::flip_mean)});
    }
  }
  for (const auto* list : {&brdf.not_formed, &report.not_formed}) {
    for (const NotFormed& missing : *list) text += fmt::format("  no {}: {}\n", missing.metric, missing.reason);
  }
  return text;
}

}  // namespace lobefit
