#include "cli/fit_text.h"

#include <fmt/format.h>

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
    text += fmt::format("  {:<26} {:>12.6g}  {:<27} {:>13.2e}{}\n", p.name, p.estimate.value,
                        p.estimate.at_bound || !p.estimate.identifiable ? "-"
                        : p.estimate.standard_error > 0.0
                            ? fmt::format("[{:.6g}, {:.6g}]", p.estimate.ci_low, p.estimate.ci_high)
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

}  // namespace lobefit
