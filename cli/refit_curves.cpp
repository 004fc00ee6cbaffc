#include "cli/refit_curves.h"

#include <fmt/format.h>

#include <iostream>
#include <set>

#include "cli/output_folder.h"
#include "fit/curve_recipe.h"
#include "reference/output_file.h"
#include "report/chart.h"
#include "report/figure.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

const char* contested_text(bool free) { return free ? "free" : "fixed"; }

std::string series_text(const CurveSeries& series) {
  return fmt::format("{}, ρ = {:g}", series.reference->name, series.albedo);
}

const FitParameter* find_parameter(const Fit& fit, const std::string& name) {
  const auto found = std::ranges::find(fit.parameters, name, &FitParameter::name);
  return found == fit.parameters.end() ? nullptr : &*found;
}

std::string value_text(const CurveRow& row, const std::string& name) {
  const FitParameter* p = find_parameter(row.fit, name);
  if (!p) return "";
  if (!p->free) return fmt::format("({:g})", p->estimate.value);
  if (!p->estimate.identifiable) return "undecided";
  if (!p->estimate.at_bound) return fmt::format("{:.4g}", p->estimate.value);
  std::string text = fmt::format("**{:.4g}**", p->estimate.value);
  const FitParameter* beyond = row.beyond ? find_parameter(*row.beyond, name) : nullptr;
  if (beyond)
    text += fmt::format(" → {:.4g}{}", beyond->estimate.value, beyond->estimate.at_bound ? " (runs away)" : "");
  return text;
}

/// "0.31 + 0.2 √α - 0.1 α"
std::string curve_text(const Curve& curve) {
  const auto& c = curve.coefficients;
  return fmt::format("{:.4f} {} {:.4f} √α {} {:.4f} α", c[0], c[1] < 0.0 ? "-" : "+", std::abs(c[1]),
                     c[2] < 0.0 ? "-" : "+", std::abs(c[2]));
}

std::string result_page(const CurveRecipe& recipe, const CurveResult& result, const std::string& command) {
  std::string page = "# " + recipe.title + "\n\n" + recipe.description + "\n\n**" + result.conclusion + "**\n\n";
  page += "Made by `" + command + "`, lobefit " LOBEFIT_VERSION ".\n\n";

  page += "## rms per model\n\n![rms](rms.png)\n\n| reference | ρ | α |";
  for (const CurveModel& model : recipe.models) {
    page += fmt::format(" {0}, {1} free | {0}, {1} fixed | fixed/free |", model.model, recipe.contested_name);
  }
  page += "\n|---|---|---|";
  for (std::size_t i = 0; i < 3 * recipe.models.size(); ++i) page += "---|";
  page += "\n";
  // Series come in pairs, free and fixed, model by model.
  const std::size_t per_reference = 2 * recipe.models.size();
  for (std::size_t s = 0; s < result.series.size(); s += per_reference) {
    for (std::size_t i = 0; i < recipe.alphas.size(); ++i) {
      page += fmt::format("| {} | {:g} | {:g} |", result.series[s].reference->name, result.series[s].albedo,
                          recipe.alphas[i]);
      for (std::size_t m = 0; m < recipe.models.size(); ++m) {
        const double free = result.row(s + 2 * m, i, recipe).rms, held = result.row(s + 2 * m + 1, i, recipe).rms;
        page += fmt::format(" {:.4f} | {:.4f} | {:.2f} |", free, held, held / free);
      }
      page += "\n";
    }
  }

  page +=
      "\n## Parameters\n\nBold values lie on a bound; what follows the arrow is the optimum with wider bounds "
      "(\"runs away\": it meets those too). Values in parentheses were held.\n";
  for (std::size_t s = 0; s < result.series.size(); ++s) {
    const CurveSeries& series = result.series[s];
    std::vector<std::string> names = recipe.free;
    names.insert(names.end(), recipe.contested.begin(), recipe.contested.end());
    page += fmt::format("\n### {}, {}, {} {}\n\n| α |", series.model->model, series_text(series), recipe.contested_name,
                        contested_text(series.contested_free));
    for (const std::string& name : names) page += " " + name + " |";
    page += " rms | rms of the lowest minimum | rms beyond bounds | rms of curves |\n|---|";
    for (std::size_t i = 0; i < names.size() + 4; ++i) page += "---|";
    page += "\n";
    for (std::size_t i = 0; i < recipe.alphas.size(); ++i) {
      const CurveRow& row = result.row(s, i, recipe);
      page += fmt::format("| {:g} |", recipe.alphas[i]);
      for (const std::string& name : names) page += " " + value_text(row, name) + " |";
      page +=
          fmt::format(" {:.4f}{} | {} | {} | {:.4f} |\n", row.rms, row.fit.solution.converged ? "" : " (not converged)",
                      row.lowest ? fmt::format("{:.4f} (not usable)", row.rms_lowest) : "",
                      row.beyond ? fmt::format("{:.4f}", row.rms_beyond) : "", series.rms[i]);
    }
    page += fmt::format("\nCurves, clamped to the bounds; they lose at most {:.1f} %{}:\n\n", 100.0 * series.worst_loss,
                        series.worst_loss <= recipe.tolerance ? "" : ", **more than the recipe tolerates**");
    for (const Curve& curve : series.curves) page += "- " + curve.parameter + " = " + curve_text(curve) + "\n";
  }

  if (!result.comparisons.empty()) {
    page +=
        "\n## What is called negligible\n\nrms of the model against facets that carry c1 themselves (Monte Carlo), and "
        "without c1 on either side; what c1 does to the facets, and by how much what it does to the model misses that."
        "\n\n| comparison | α | model | without c1 | effect of c1 | missed | missed/effect |\n"
        "|---|---|---|---|---|---|---|\n";
    for (const ComparisonRow& row : result.comparisons) {
      page +=
          fmt::format("| {} | {:g} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {:.2f} |\n", row.comparison->name, row.alpha,
                      row.rms, row.rms_plain, row.rms_effect, row.rms_missed, row.rms_missed / row.rms_effect);
    }
  }
  return page;
}

void print_result(const CurveRecipe& recipe, const CurveResult& result) {
  fmt::print("  {:<18} {:<12} {:>4} {:<7}", "model", "reference", "ρ", recipe.contested_name);
  std::vector<std::size_t> shown;  // up to 5 alphas spread over all
  const std::size_t count = std::min<std::size_t>(5, recipe.alphas.size());
  for (std::size_t i = 0; i < count; ++i)
    shown.push_back(count == 1 ? 0 : i * (recipe.alphas.size() - 1) / (count - 1));
  for (const std::size_t i : shown) fmt::print(" {:>9}", fmt::format("α={:g}", recipe.alphas[i]));
  fmt::print("  curves lose\n");
  for (std::size_t s = 0; s < result.series.size(); ++s) {
    const CurveSeries& series = result.series[s];
    fmt::print("  {:<18} {:<12} {:>4g} {:<7}", series.model->model, series.reference->name, series.albedo,
               contested_text(series.contested_free));
    for (const std::size_t i : shown) fmt::print(" {:>9.4f}", result.row(s, i, recipe).rms);
    fmt::print("  {:>5.1f} %\n", 100.0 * series.worst_loss);
  }
  fmt::print("\n{}\n", result.conclusion);
}

/// The parameters of one model over alpha: a panel each, a colour per reference.
void write_parameters(const CurveRecipe& recipe, const CurveResult& result, const CurveModel& model,
                      const OutputFolder& folder) {
  std::vector<std::size_t> chosen;
  std::vector<std::string> labels;
  for (std::size_t s = 0; s < result.series.size(); ++s) {
    if (result.series[s].model != &model || !result.series[s].contested_free) continue;
    chosen.push_back(s);
    labels.push_back(series_text(result.series[s]));
  }
  std::vector<ChartPanel> panels;
  for (const Curve& named : result.series[chosen.front()].curves) {
    const bool is_albedo = named.parameter == "albedo";
    ChartPanel panel{.title = is_albedo ? "albedo / ρ" : named.parameter};
    std::vector<double> sorted;
    for (const std::size_t s : chosen) {
      ChartSeries line;
      const double unit = is_albedo ? result.series[s].albedo : 1.0;
      for (std::size_t i = 0; i < recipe.alphas.size(); ++i) {
        const FittedVariable& estimate = find_parameter(result.row(s, i, recipe).fit, named.parameter)->estimate;
        const double half = estimate.at_bound || !estimate.identifiable ? 0.0 : 1.96 * estimate.misfit_standard_error;
        line.points.push_back({recipe.alphas[i], estimate.value / unit, half / unit, estimate.at_bound});
        sorted.push_back(estimate.value / unit);
      }
      const Curve& curve = *std::ranges::find(result.series[s].curves, named.parameter, &Curve::parameter);
      constexpr int steps = 100;
      for (int k = 0; k <= steps; ++k) {
        const double alpha =
            recipe.alphas.front() + (recipe.alphas.back() - recipe.alphas.front()) * k / static_cast<double>(steps);
        line.line.emplace_back(alpha, curve.at(alpha) / unit);
      }
      panel.series.push_back(std::move(line));
    }
    // A few values that run away should not flatten the others.
    std::ranges::sort(sorted);
    const double common = sorted[sorted.size() * 8 / 10];
    panel.upper = sorted.back() > 8.0 && sorted.back() > 3.0 * common && common > 0.0 ? 2.0 * common : sorted.back();
    panel.lower = std::min(0.0, sorted.front());
    if (panel.upper <= 1.0 && panel.upper > 0.5) panel.upper = 1.0;
    if (!(panel.upper > panel.lower)) panel.upper = panel.lower + 1.0;
    if (panel.upper < sorted.back()) panel.title += fmt::format(" (up to {:.3g})", sorted.back());
    panel.upper += 0.06 * (panel.upper - panel.lower);
    panel.lower -= 0.04 * (panel.upper - panel.lower);
    panels.push_back(std::move(panel));
  }
  const std::string program = chart_figure(
      panels, labels, fmt::format("{}: parameters over α, {} parameters free", model.model, recipe.contested_name),
      "points: fits alpha by alpha with 95 % intervals from their misfit, hollow where at a bound; lines: the "
      "quadratics in √α, fitted to all alphas at once",
      "α");
  for (const char* extension : {".svg", ".png"})
    write_figure(program, folder.path("parameters." + model.model + extension), true, chart_figure_size(panels));
}

void write_rms(const CurveRecipe& recipe, const CurveResult& result, const OutputFolder& folder) {
  std::vector<std::size_t> shown;
  for (const double alpha : {0.1, 0.25, 0.5, 1.0}) {
    const auto nearest = std::ranges::min_element(recipe.alphas, {}, [&](double a) { return std::abs(a - alpha); });
    const auto i = static_cast<std::size_t>(nearest - recipe.alphas.begin());
    if (std::ranges::find(shown, i) == shown.end()) shown.push_back(i);
  }
  const std::size_t per_reference = 2 * recipe.models.size();
  std::vector<std::string> labels;
  for (const CurveModel& model : recipe.models) {
    for (const bool free : {true, false})
      labels.push_back(fmt::format("{}, {} {}", model.model, recipe.contested_name, contested_text(free)));
  }
  std::vector<BarPanel> panels;
  for (std::size_t s = 0; s < result.series.size(); s += per_reference) {
    BarPanel panel{.title = series_text(result.series[s])};
    for (const std::size_t i : shown) {
      BarGroup group{.title = fmt::format("α = {:g}", recipe.alphas[i])};
      for (std::size_t k = 0; k < per_reference; ++k) {
        group.bars.push_back(result.row(s + k, i, recipe).rms);
        group.ticks.push_back(result.series[s + k].rms[i]);
      }
      panel.groups.push_back(std::move(group));
    }
    panels.push_back(std::move(panel));
  }
  const std::string program = bar_figure(panels, labels, "What each form reaches on rough diffuse facets",
                                         "bars: fitted alpha by alpha; black ticks: the curves in √α",
                                         "weighted rms of π ({/:Italic f} - {/:Italic f}_{ref}) cos θ_i / ρ");
  for (const char* extension : {".svg", ".png"})
    write_figure(program, folder.path(std::string("rms") + extension), true, bar_figure_size(panels));
}

void write_slices(const CurveRecipe& recipe, const CurveResult& result, const OutputFolder& folder) {
  const std::size_t per_reference = 2 * recipe.models.size();
  for (const CurveReference& reference : recipe.references) {
    // The brightest albedo of each reference.
    std::size_t first = 0;
    for (std::size_t s = 0; s < result.series.size(); s += per_reference) {
      if (result.series[s].reference == &reference) first = s;
    }
    const Table table = series_table(recipe, result, result.series[first]);
    std::vector<LabelledTable> lines;
    for (std::size_t s = first; s < first + per_reference; ++s) {
      const std::string label = fmt::format("{}, {} {}", result.series[s].model->model, recipe.contested_name,
                                            contested_text(result.series[s].contested_free));
      lines.push_back({label, table.with_values(label, series_values(recipe, result, s))});
    }
    SliceChoice choice{.theta_o = table.grid.theta_o.size() * 2 / 3};
    choice.both_sides = table.grid.phi.values.front() == 0.0 && table.grid.phi.values.back() == 180.0;
    const std::string program = slice_figure(table, lines, choice, series_text(result.series[first]));
    for (const char* extension : {".svg", ".png"})
      write_figure(program, folder.path("slices." + reference.name + extension), true,
                   slice_figure_size(table, choice));
  }
}

}  // namespace

void refit_curves(const fs::path& path, const std::string& output, const Context& context) {
  const CurveRecipe recipe = CurveRecipe::read(path);
  OutputFolder folder(output.empty() ? fs::path("out") / recipe.name : fs::path(output), context.force);
  const auto monitor = context.monitor();
  CurveResult result = run_recipe(recipe, context.seed, *monitor);
  for (CurveTable& table : result.tables) {
    monitor->check();
    table.table.command = context.command;
    table.table.write(folder.path(table.name + ".exr"));
  }
  write_rms(recipe, result, folder);
  for (const CurveModel& model : recipe.models) write_parameters(recipe, result, model, folder);
  write_slices(recipe, result, folder);
  monitor->check();
  const Json document = result.json(recipe, context.command, context.seed);
  folder.write("result.md", result_page(recipe, result, context.command));
  folder.write("result.json", document.dump(2) + "\n");
  folder.commit();
  if (context.json) {
    std::cout << document.dump(2) << "\n";
  } else {
    print_result(recipe, result);
    fmt::print("\nWritten to {}: result.json, result.md, tables and figures; open {}\n", folder.destination().string(),
               (folder.destination() / "rms.png").string());
  }
}

}  // namespace lobefit
