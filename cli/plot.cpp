// lobefit plot: figures as SVG or PNG.
#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/plot_pareto.h"
#include "cli/sampling.h"
#include "cli/slice.h"
#include "reference/output_file.h"
#include "report/figure.h"

namespace lobefit {

namespace {

struct PlotArguments {
  std::string name, output, grid = "default", title;
  std::vector<std::string> settings, axes, models;
  double theta_o = 0.0, phi = 0.0;
  bool both_sides = false;
  int width = 0, height = 0;  // 0: what suits the figure
};

/// A table file, or a reference or model rendered here.
Table table_of(const PlotArguments& a, const Context& context) {
  if (is_file(a.name)) {
    if (!a.settings.empty() || !a.axes.empty()) {
      throw Error(ExitCode::usage, "a table has its parameters already", "plot", "leave out --set and --axis");
    }
    const BrdfFile file = read_brdf_file(a.name);
    // Figures cut along angles, which measured grids do not have.
    return file.table.coordinates == Coordinates::spherical ? file.table : file.resampled(Grid::named_or_file(a.grid));
  }
  const auto monitor = context.monitor();
  const auto prepared = [&](ParameterValues values) {
    set_parameters(values, a.settings);
    return values;
  };
  const Reference* reference = find_reference_or_null(a.name);
  const Model* model = reference ? nullptr : &find_model(a.name);
  const Grid grid = Grid::named_or_file(a.grid, reference ? reference->sphere : is_hair(model->info->kind));
  if (reference) {
    return render(*reference, prepared(reference->defaults()), parse_axes(a.axes), grid,
                  {.sampling = {.samples = 1u << 14, .seed = context.seed}}, *monitor);
  }
  return render(*model, prepared(model->defaults()), parse_axes(a.axes), grid, *monitor);
}

/// "NAME:k=v,…" or "fit.json:k=v,…" over the table; a value that is no number is a mapping of a table axis.
LabelledTable model_on(const std::string& text, const Table& table) {
  const std::size_t colon = text.find(':');
  std::vector<std::string> settings, mappings;
  for (std::size_t begin = colon; begin != std::string::npos && begin + 1 < text.size();) {
    const std::size_t comma = text.find(',', begin + 1);
    const std::string setting =
        text.substr(begin + 1, comma == std::string::npos ? std::string::npos : comma - begin - 1);
    const std::size_t equals = setting.find('=');
    const bool numeric = equals != std::string::npos && equals + 1 < setting.size() &&
                         setting.find_first_not_of("0123456789.+-eE", equals + 1) == std::string::npos;
    (numeric ? settings : mappings).push_back(setting);
    begin = comma;
  }
  const ModelChoice choice = choose_for_table(text.substr(0, colon), settings, mappings, table);
  const std::string label = choice.fit ? std::filesystem::path(text.substr(0, colon)).stem().string() : text;
  return {label, TableModel(*choice.model, choice.values, table, choice.mappings).render()};
}

std::size_t index_on(const Axis& axis, double angle, const char* option) {
  const auto found = std::min_element(axis.values.begin(), axis.values.end(),
                                      [&](double x, double y) { return std::abs(x - angle) < std::abs(y - angle); });
  if (std::abs(*found - angle) > 1e-6) {
    throw Error(ExitCode::usage, axis.name + " = " + number_text(angle) + " is no angle of the table", option,
                "the nearest is " + number_text(*found));
  }
  return static_cast<std::size_t>(found - axis.values.begin());
}

}  // namespace

void add_plot(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "plot",
      "Figures as SVG or PNG\n"
      "  lobefit plot slices truth.exr --with proxima --with fit.json --with chan_2024 -o slices.svg\n"
      "  lobefit plot residuals truth.exr --with proxima --with eon:roughness=0.4*alpha^0.5 --phi 180 -o maps.png\n"
      "  lobefit plot slices microfacet_diffuse --axis alpha=0.1,0.5,1 --with proxima -o slices.png\n"
      "  lobefit plot pareto -o pareto.svg");
  verb->require_subcommand(1);
  const auto add = [&](const char* name, const char* description, auto figure, auto suitable_size) {
    CLI::App* kind = verb->add_subcommand(name, description);
    kind->fallthrough();
    const auto a = std::make_shared<PlotArguments>();
    kind->add_option("NAME", a->name, "Table or measured file, reference or model")->required();
    add_repeatable(*kind, "--with", a->models,
                   "Model or fit to draw against it, NAME or NAME:parameter=value,… (repeatable);\n"
                   "a value SCALE*AXIS^POWER maps a table axis");
    add_repeatable(*kind, "--set", a->settings, "NAME=VALUE of a reference or model (repeatable)");
    add_repeatable(*kind, "--axis", a->axes, "NAME=v1,v2,… of a reference or model (repeatable)");
    kind->add_option("--grid", a->grid, "Grid for a reference, a model or a measured file")->capture_default_str();
    kind->add_option("--theta-o", a->theta_o, "View angle in degrees")->capture_default_str();
    kind->add_option("--phi", a->phi, "Azimuth difference in degrees: 0 is the retro side")->capture_default_str();
    kind->add_option("--title", a->title, "Title (default: the name)");
    kind->add_option("--width", a->width, "Width in pixels (default: what suits the panels)")
        ->check(CLI::Range(200, 8000));
    kind->add_option("--height", a->height, "Height in pixels")->check(CLI::Range(200, 8000));
    if (std::string_view(name) == "slices") {
      kind->add_flag("--both-sides", a->both_sides, "Also the azimuth 180 - phi, at negative theta_i");
    }
    kind->add_option("-o,--output", a->output, "Figure to write, .svg or .png")->required();
    kind->callback([&context, a, figure, suitable_size] {
      const Table table = table_of(*a, context);
      std::vector<LabelledTable> lines;
      for (const std::string& text : a->models) lines.push_back(model_on(text, table));
      const SliceChoice choice{.theta_o = index_on(table.grid.theta_o, a->theta_o, "--theta-o"),
                               .phi = index_on(table.grid.phi, a->phi, "--phi"),
                               .both_sides = a->both_sides};
      FigureSize size = suitable_size(table, lines.size(), choice);
      if (a->width > 0) size.width = a->width;
      if (a->height > 0) size.height = a->height;
      write_figure(figure(table, lines, choice, a->title.empty() ? a->name : a->title), a->output, context.force, size);
    });
  };
  add(
      "slices", "pi f cos(theta_i) along theta_i, a panel per parameter row, with error bars",
      [](const Table& t, const std::vector<LabelledTable>& m, const SliceChoice& c, const std::string& title) {
        return slice_figure(t, m, c, title);
      },
      [](const Table& t, std::size_t, const SliceChoice& c) { return slice_figure_size(t, c); });
  add(
      "residuals", "model minus reference over (theta_i, theta_o), a panel per model and parameter row",
      [](const Table& t, const std::vector<LabelledTable>& m, const SliceChoice& c, const std::string& title) {
        return residual_figure(t, m, c, title);
      },
      [](const Table& t, std::size_t models, const SliceChoice& c) { return residual_figure_size(t, models, c); });
  add_plot_pareto(*verb, context);
}

}  // namespace lobefit
