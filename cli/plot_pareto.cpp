#include "cli/plot_pareto.h"

#include <fmt/format.h>

#include <iostream>

#include "evaluate/callisto_cost.h"
#include "evaluate/float_model.h"
#include "evaluate/operation_cost.h"
#include "fit/diffuse_errors.h"
#include "reference/output_file.h"
#include "report/pareto_figure.h"

namespace lobefit {

namespace {

struct CostAndError {
  DiffuseError error;
  OperationCount operations;
};

OperationCount operations_of(const DiffuseError& form) {
  return form.model == "callisto_lambert" ? callisto_diffuse_operations()
                                          : count_operations(find_float_model(form.model).trace());
}

std::vector<ParetoPanel> panels_of(const std::vector<CostAndError>& forms) {
  std::vector<ParetoPanel> panels;
  for (std::size_t r = 0; r < diffuse_reference_names.size(); ++r) {
    ParetoPanel panel{.title = "against " + std::string(diffuse_reference_names[r]), .points = {}};
    for (const CostAndError& form : forms) {
      panel.points.push_back({form.error.label, static_cast<double>(form.operations.total()), form.error.rms[r]});
    }
    panels.push_back(std::move(panel));
  }
  return panels;
}

void print(const std::vector<CostAndError>& forms, const std::vector<ParetoPanel>& panels, const Context& context) {
  std::array<std::vector<bool>, 2> on_front;
  for (std::size_t r = 0; r < panels.size(); ++r) {
    on_front[r].resize(forms.size());
    for (const std::size_t k : pareto_front(panels[r].points)) on_front[r][k] = true;
  }
  if (context.json) {
    Json list = Json::array();
    for (std::size_t k = 0; k < forms.size(); ++k) {
      const CostAndError& form = forms[k];
      list.push_back({{"label", form.error.label},
                      {"model", form.error.model},
                      {"note", form.error.note},
                      {"operations", form.operations.total()},
                      {"alu_cycles", alu_cycles(form.operations)},
                      {"rms", {{"one_bounce", form.error.rms[0]}, {"all_bounces", form.error.rms[1]}}},
                      {"front", {{"one_bounce", bool(on_front[0][k])}, {"all_bounces", bool(on_front[1][k])}}}});
    }
    std::cout << Json{{"forms", list}}.dump(2) << "\n";
    return;
  }
  fmt::print("  {:<22} {:>10} {:>7} {:>12} {:>12}\n", "form", "operations", "cycles", "one bounce", "all bounces");
  for (std::size_t k = 0; k < forms.size(); ++k) {
    const CostAndError& form = forms[k];
    fmt::print("  {:<22} {:>10} {:>7} {:>11.4f}{} {:>11.4f}{}  {}\n", form.error.label, form.operations.total(),
               alu_cycles(form.operations), form.error.rms[0], on_front[0][k] ? "*" : " ", form.error.rms[1],
               on_front[1][k] ? "*" : " ", form.error.note);
  }
  fmt::print("  rms of pi (f - f_ref) cos(theta_i) at albedo 1; * none is both cheaper and closer\n");
}

}  // namespace

void add_plot_pareto(CLI::App& plot, Context& context) {
  struct Arguments {
    std::string output;
    DiffuseErrorOptions errors;
    FigureSize size{1100, 560};
  };
  CLI::App* verb = plot.add_subcommand(
      "pareto",
      "Cost against error of the rough diffuse forms, with the front that none beats in both\n"
      "  lobefit plot pareto -o pareto.svg\n"
      "  lobefit plot pareto --json\n"
      "Against facets of GGX slopes under height-correlated Smith masking, of one bounce (exact) and of all of them "
      "(Monte Carlo),\n"
      "at albedo 1 over 20 alphas and the default grid, weighted evenly. Against one bounce forms go without their own "
      "term for\n"
      "further ones; operations are those of the whole form, of Callisto those of c1 on Lambert.");
  verb->fallthrough();
  const auto a = std::make_shared<Arguments>();
  verb->add_option("-o,--output", a->output, "Figure to write, .svg or .png (default: numbers only)")
      ->check([](const std::string& path) {
        return path.ends_with(".svg") || path.ends_with(".png") ? "" : "figures are .svg or .png";
      });
  verb->add_option("--samples", a->errors.samples, "Of the reference of all bounces, at each entry")
      ->check(CLI::Range(std::uint64_t{64}, std::uint64_t{1} << 24))
      ->capture_default_str();
  verb->add_option("--width", a->size.width, "Width in pixels")->check(CLI::Range(500, 8000))->capture_default_str();
  verb->add_option("--height", a->size.height, "Height in pixels")->check(CLI::Range(300, 8000))->capture_default_str();
  verb->callback([&context, a] {
    a->errors.seed = context.seed;
    // Refused now rather than after the work.
    if (!a->output.empty()) OutputFile(a->output, context.force);
    const auto monitor = context.monitor();
    std::vector<CostAndError> forms;
    for (DiffuseError& error : diffuse_errors(a->errors, *monitor)) {
      const OperationCount operations = operations_of(error);
      forms.push_back({std::move(error), operations});
    }
    const std::vector<ParetoPanel> panels = panels_of(forms);
    print(forms, panels, context);
    if (a->output.empty()) return;
    write_figure(pareto_figure(panels, "What rough diffuse costs, and how close it comes",
                               "Forms against Lambertian facets of GGX slopes under Smith masking; on the dashed line "
                               "nothing is both cheaper and closer",
                               "scalar operations", "rms of π (f - reference) cos θi", a->size),
                 a->output, context.force, a->size);
  });
}

}  // namespace lobefit
