#include "report/fit_text.h"

#include <fmt/format.h>

#include <algorithm>

namespace lobefit {

std::string fit_text(const Fit& fit) {
  std::string text =
      fmt::format("  {:<26} {:>12}  {:<27} {:>13}\n", "parameter", "value", "95 % interval", "misfit stderr");
  for (const FitParameter& p : fit.parameters) {
    if (!p.free) {
      text += fmt::format("  {:<26} {:>12.6g}  fixed\n", p.name, p.estimate.value);
      continue;
    }
    std::string remark;
    if (!p.estimate.identifiable)
      remark = "  not identifiable";
    else if (p.estimate.at_bound)
      remark = "  at its bound";
    text += fmt::format(
        "  {:<26} {:>12.6g}  {:<27} {:>13.2e}{}\n", p.name, p.estimate.value,
        p.estimate.at_bound || !p.estimate.identifiable ? "-"
        : p.estimate.standard_error > 0.0 ? fmt::format("[{:.6g}, {:.6g}]", p.estimate.ci_low, p.estimate.ci_high)
        : p.name.find("_tint") != std::string::npos && p.estimate.misfit_standard_error == 0.0 ? "1 by convention"
                                                                                               : "exact table",
        p.estimate.misfit_standard_error, remark);
  }
  for (const FitMetric& metric : fit.metrics)
    text += fmt::format("  rms {:<22} {:>12.6g}\n", metric.name, metric.value);
  for (const FitMetric& metric : fit.holdout)
    text += fmt::format("  held-out rms {:<13} {:>12.6g}\n", metric.name, metric.value);
  for (const std::string& remark : fit.solution.remarks) text += "  note: " + remark + "\n";
  text += fmt::format("  {} after {} iterations\n", fit.solution.converged ? "converged" : "NOT converged",
                      fit.solution.iterations);
  return text;
}

std::string tiers_text(const std::vector<TierFit>& tiers) {
  if (tiers.empty()) return "";
  const Fit& last = tiers.back().fit;
  const std::string metric(quantity_names[static_cast<std::size_t>(last.options.quantity)]);
  const auto value = [&](const std::vector<FitMetric>& metrics) {
    const auto found = std::ranges::find(metrics, metric, &FitMetric::name);
    return found != metrics.end() ? fmt::format("{:12.6g}", found->value) : std::string("           -");
  };
  std::string text = fmt::format("\n  {:<10} {:>6} {:>12} {:>12}\n", "tier", "free", "rms " + metric, "held out");
  for (const TierFit& tier : tiers) {
    text += fmt::format("  {:<10} {:>6} {} {}\n", tier_name(tier.tier), tier.fit.solution.variables.size(),
                        value(tier.fit.metrics), value(tier.fit.holdout));
  }
  for (std::size_t k = 1; k < tiers.size(); ++k) text += "  " + tiers[k].verdict(tiers[k - 1].tier) + "\n";
  return text;
}

std::string interval_text(const FitParameter& p) {
  if (!p.estimate.identifiable) return "not identifiable";
  if (p.estimate.at_bound) return fmt::format("{:.4g}, at its bound", p.estimate.value);
  if (p.estimate.standard_error == 0.0) return fmt::format("{:.5f}", p.estimate.value);
  return fmt::format("{:.5f} [{:.5f}, {:.5f}]", p.estimate.value, p.estimate.ci_low, p.estimate.ci_high);
}

}  // namespace lobefit
