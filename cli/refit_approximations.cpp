#include "cli/refit_approximations.h"

#include <fmt/format.h>

#include <cmath>
#include <iostream>
#include <utility>

#include "cli/forms_text.h"
#include "cli/output_folder.h"
#include "evaluate/check.h"
#include "evaluate/form_shader.h"
#include "evaluate/shader.h"
#include "fit/approximation_recipe.h"
#include "report/chart.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

std::string operations_text(const Form& form) {
  if (!form.has_shader) return "an integral";
  return fmt::format("{} operations", form_operations(form.name, form.published()).total());
}

std::string result_page(const ApproximationRecipe& recipe, const ApproximationResult& result,
                        const std::vector<JsonReader>& lines, const std::string& command) {
  std::string page = "# " + recipe.title + "\n\n" + recipe.description + "\n\n";
  page +=
      "Made by `" + command +
      "`, lobefit " LOBEFIT_VERSION
      ". Targets are exact. Intervals are 95 % by a jackknife over ten blocks of the first axis: how far a constant "
      "would move with the domain. Constants in parentheses were held. Errors are in the row's metric over its "
      "domain.\n\n";
  for (std::size_t i = 0; i < result.fits.size();) {
    const ApproximationRow& row = *result.fits[i].row;
    page += "## " + row.name + "\n\n";
    if (!row.note.empty()) page += row.note + "\n\n";
    page += fmt::format("`{}` ({}; {}) for `{}`: {}. Over {}; fitted for the least {} {} error.\n\n", row.form->formula,
                        row.form->source, operations_text(*row.form), row.target->name, row.target->title,
                        form_domain_text(lines[i]), form_norm_names[static_cast<std::size_t>(row.norm)],
                        form_metric_names[static_cast<std::size_t>(row.metric)]);
    page += "|" + (row.each.empty() ? std::string() : " " + row.each + " |");
    for (const FormConstant& constant : row.form->constants) page += fmt::format(" {} |", constant.name);
    page += " rms published | rms refit | max published | max refit |";
    if (row.has_published) page += " published is optimal by |";
    std::size_t columns = row.form->constants.size() + 4 + (row.each.empty() ? 0 : 1) + (row.has_published ? 1 : 0);
    page += "\n|";
    while (columns-- > 0) page += "---|";
    page += "\n";
    if (row.has_published) {
      page += "|" + (row.each.empty() ? std::string() : std::string(" published |"));
      for (const PublishedConstant& constant : row.published) page += fmt::format(" {:.7g} |", constant.value);
      page += " | | | | |\n";
    }
    for (; i < result.fits.size() && result.fits[i].row == &row; ++i) {
      const ApproximationFit& fit = result.fits[i];
      page += "|" + (row.each.empty() ? std::string() : fmt::format(" {:g} |", fit.each_value));
      for (const FormConstant& constant : row.form->constants) {
        page += " " + form_constant_text(lines[i].at("params").at(constant.name)) + " |";
      }
      for (const char* norm : {"rms", "max"}) {
        page += " " + (row.has_published ? form_error_text(lines[i], norm, "published") : "–") + " | " +
                form_error_text(lines[i], norm, "refit") + " |";
      }
      if (row.has_published) page += " " + form_verdict(lines[i]) + " |";
      page += "\n";
    }
    const ApproximationFit& last = result.fits[i - 1];
    page += "\n";
    for (std::size_t r = 0; r < row.rivals.size(); ++r) {
      const Form& rival = *row.rivals[r];
      page += fmt::format("- beside it `{}` as published ({}; {}): rms {}, max {}\n", rival.formula, rival.source,
                          operations_text(rival), form_error_text(lines[i - 1], "rms", rival.name),
                          form_error_text(lines[i - 1], "max", rival.name));
    }
    if (last.integral) {
      page += fmt::format("- integral over the circle: target {:.5g}, published {:.5g}, refit {:.5g}\n",
                          last.integral->target, last.integral->published, last.integral->refit);
    }
    page += fmt::format("\n![{0}]({0}.png)\n\n", row.name);
  }
  return page;
}

void print_result(const ApproximationResult& result, const std::vector<JsonReader>& lines) {
  fmt::print("  {:<34} {:<46} {:>12} {:>12}  {}\n", "row", "constants", "max publ.", "max refit",
             "published is optimal by");
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const ApproximationFit& fit = result.fits[i];
    const ApproximationRow& row = *fit.row;
    std::string constants;
    for (const std::size_t k : row.free) {
      constants += fmt::format("{}{} {:.5g}", constants.empty() ? "" : "  ", row.form->constants[k].name,
                               fit.constants[k].value);
    }
    if (row.free.size() > 4) constants = fmt::format("{} constants", row.free.size());
    fmt::print("  {:<34} {:<46} {:>12} {:>12}  {}\n", form_line_title(lines[i]), constants,
               row.has_published ? form_error_text(lines[i], "max", "published") : "–",
               form_error_text(lines[i], "max", "refit"), form_verdict(lines[i]));
  }
}

/// "θ_d, degrees", "cos θ", "α"; gnuplot sets what follows _ below the line.
std::string axis_label(const DomainAxis& axis) {
  const bool prefixed = axis.argument.starts_with("cos_") || axis.argument.starts_with("sin_");
  std::string label = !axis.degrees ? axis.argument : prefixed ? axis.argument.substr(4) : "theta";
  if (!axis.degrees && prefixed) label[3] = ' ';
  for (const auto& [name, letter] : {std::pair("theta", "θ"), std::pair("phi", "φ"), std::pair("alpha", "α")}) {
    if (const std::size_t at = label.find(name); at != std::string::npos) {
      label.replace(at, std::string_view(name).size(), letter);
    }
  }
  return label + (axis.degrees ? ", degrees" : "");
}

/// Errors along the first axis of the domain: published, refit and rivals; of a second axis up to four panels.
void write_errors(const ApproximationFit& fit, const std::string& title, const OutputFolder& folder) {
  const ApproximationRow& row = *fit.row;
  const DomainAxis& axis = row.domain.axes.front();
  if (axis.values.size() < 2) return;
  struct Line {
    std::string label;
    const Form* form;
    std::vector<double> constants;
  };
  std::vector<Line> lines;
  if (row.has_published) lines.push_back({"published", row.form, row.published_values()});
  lines.push_back({row.has_published ? "refit" : "fit", row.form, fit.values()});
  for (const Form* rival : row.rivals) lines.push_back({std::string(rival->name), rival, rival->published()});
  std::vector<std::string> labels;
  for (const Line& line : lines) labels.push_back(line.label);

  // The other axes at up to four places, together.
  const std::size_t others = row.domain.axes.size() > 1 ? row.domain.axes[1].values.size() : 1;
  const std::size_t panel_count = std::min<std::size_t>(others, 4);
  std::vector<ChartPanel> panels;
  for (std::size_t p = 0; p < panel_count; ++p) {
    FormDomain slice = row.domain;
    std::string place;
    for (std::size_t k = 1; k < slice.axes.size(); ++k) {
      DomainAxis& other = slice.axes[k];
      const std::size_t at = panel_count == 1 ? 0 : p * (other.values.size() - 1) / (panel_count - 1);
      const std::string label = axis_label(other);
      place += fmt::format("{}{} = {:.3g}{}", place.empty() ? "" : ", ", label.substr(0, label.find(',')),
                           other.given[at], other.degrees ? "°" : "");
      other.values = {other.values[at]};
    }
    const std::vector<std::vector<double>> points = domain_points(row, slice, fit.each_value);
    ChartPanel panel{.title = place, .series = std::vector<ChartSeries>(lines.size()), .lower = 0.0, .upper = 0.0};
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double truth = row.target->evaluate(points[i]);
      for (std::size_t l = 0; l < lines.size(); ++l) {
        const std::vector<double> x = form_arguments(*lines[l].form, *row.target, points[i]);
        double error = lines[l].form->evaluate(lines[l].constants, x, nullptr) - truth;
        if (row.metric == FormMetric::relative) error = truth != 0.0 ? 100.0 * error / truth : 0.0;
        panel.series[l].line.emplace_back(axis.given[i], error);
        if (l > (row.has_published ? 1u : 0u)) continue;  // rivals may leave the picture
        panel.lower = std::min(panel.lower, error);
        panel.upper = std::max(panel.upper, error);
      }
    }
    const double margin = 0.08 * std::max(panel.upper - panel.lower, 1e-9);
    panel.lower -= margin;
    panel.upper += margin;
    panels.push_back(std::move(panel));
  }
  const auto [low, high] = std::minmax_element(axis.given.begin(), axis.given.end());
  const double span = *high - *low;
  const double step = std::pow(10.0, std::floor(std::log10(span / 2.0)));
  const double tick = span / step > 10.0 ? 5.0 * step : span / step > 4.0 ? 2.0 * step : step;
  const std::string program =
      chart_figure(panels, labels, fmt::format("{}: error of {}", title, row.form->name),
                   row.metric == FormMetric::relative ? "relative error, per cent" : "absolute error", axis_label(axis),
                   {.left = *low, .right = *high, .tick = tick});
  for (const char* extension : {".svg", ".png"}) {
    write_figure(program, folder.path(row.name + extension), true, chart_figure_size(panels));
  }
}

/// In float against double, both with float32-rounded constants and arguments, within the bound of `lobefit check`.
Json check_in_float(const ApproximationFit& fit, const std::string& title) {
  const CheckOptions bounds;
  const ApproximationRow& row = *fit.row;
  std::vector<double> constants;
  for (const double value : fit.values()) constants.push_back(static_cast<double>(static_cast<float>(value)));
  double largest = 0.0, relative = 0.0, excess = 0.0;
  for (const std::vector<double>& point : domain_points(row, row.domain, fit.each_value)) {
    std::vector<double> x = form_arguments(*row.form, *row.target, point);
    for (double& value : x) value = static_cast<double>(static_cast<float>(value));
    const double truth = row.form->evaluate(constants, x, nullptr);
    const double error = std::abs(static_cast<double>(form_in_float(row.form->name, constants, x)) - truth);
    largest = std::max(largest, error);
    if (std::abs(truth) > smallest_relative_value) relative = std::max(relative, error / std::abs(truth));
    excess = std::max(excess, error / (bounds.relative_bound * std::abs(truth) + bounds.absolute_bound));
  }
  return {{"row", title}, {"max_abs", largest}, {"max_rel", relative}, {"passed", excess <= 1.0}};
}

}  // namespace

void refit_approximations(const fs::path& path, const std::string& output, const Context& context) {
  const ApproximationRecipe recipe = ApproximationRecipe::read(path);
  OutputFolder folder(output.empty() ? fs::path("out") / recipe.name : fs::path(output), context.force);
  const auto monitor = context.monitor();
  const ApproximationResult result = run_approximations(recipe, *monitor);

  Json document = result.json(recipe, context.command), checks = Json::array();
  bool passed = true;
  const ApproximationRow* drawn = nullptr;
  const std::vector<JsonReader> lines = JsonReader(document, "result.json").at("rows").elements();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    monitor->check();
    const ApproximationFit& fit = result.fits[i];
    const std::string title = form_line_title(lines[i]);
    if (std::exchange(drawn, fit.row) != fit.row) write_errors(fit, title, folder);
    if (!fit.row->form->has_shader) continue;
    const std::string provenance = fmt::format("Refitted by `{}`: {}.", context.command, title);
    for (const std::string& language : shader_languages()) {
      folder.write(form_line_stem(lines[i]) + "." + language,
                   form_shader(fit.row->form->name, language, fit.values(), std::span(&provenance, 1)));
    }
    checks.push_back(check_in_float(fit, title));
    passed = passed && checks.back()["passed"].get<bool>();
  }
  document["checks"] = checks;
  folder.write("result.md", result_page(recipe, result, lines, context.command));
  folder.write("result.json", document.dump(2) + "\n");
  folder.commit();
  if (context.json) {
    std::cout << document.dump(2) << "\n";
  } else {
    print_result(result, lines);
    fmt::print("\n{}\n\nWritten to {}: result.json, result.md, shaders and figures; open {}\n", result.conclusion,
               folder.destination().string(), (folder.destination() / (recipe.rows.front().name + ".png")).string());
  }
  if (!passed) {
    throw Error(ExitCode::check_failed, "a fitted form in float strays from double precision",
                folder.destination().string(), "see \"checks\" in result.json");
  }
}

}  // namespace lobefit
