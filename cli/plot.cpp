// lobefit plot: figures as SVG or PNG.
#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/plot_convergence.h"
#include "cli/plot_pareto.h"
#include "cli/sampling.h"
#include "cli/slice.h"
#include "reference/output_file.h"
#include "report/figure.h"
#include "report/image_slice.h"

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

/// "NAME:k=v,…" or "fit.json:k=v,…"; a value that is no number is a mapping of a table axis.
struct ModelText {
  std::string name, label;
  std::vector<std::string> settings, mappings;
};
ModelText parse_model(const std::string& text) {
  const std::size_t colon = text.find(':');
  ModelText result{.name = text.substr(0, colon), .label = text};
  for (std::size_t begin = colon; begin != std::string::npos && begin + 1 < text.size();) {
    const std::size_t comma = text.find(',', begin + 1);
    const std::string setting =
        text.substr(begin + 1, comma == std::string::npos ? std::string::npos : comma - begin - 1);
    const std::size_t equals = setting.find('=');
    const bool numeric = equals != std::string::npos && equals + 1 < setting.size() &&
                         setting.find_first_not_of("0123456789.+-eE", equals + 1) == std::string::npos;
    (numeric ? result.settings : result.mappings).push_back(setting);
    begin = comma;
  }
  if (is_file(result.name)) result.label = std::filesystem::path(result.name).stem().string();
  return result;
}

LabelledTable model_on(const std::string& text, const Table& table) {
  const ModelText model = parse_model(text);
  const ModelChoice choice = choose_for_table(model.name, model.settings, model.mappings, table);
  return {model.label, TableModel(*choice.model, choice.values, table, choice.mappings).render()};
}

SphereBrdf brdf_of(const Model& model, std::vector<double> flat) {
  return [&model, flat = std::move(flat)](const Direction& wi, const Direction& wo) {
    return std::optional<Rgb>(model.evaluate(flat, wi, wo));
  };
}

/// NAME and what --with names: over one row of a table, which gives models its parameters, or with parameters of their
/// own.
std::vector<LabelledBrdf> image_slice_brdfs(const PlotArguments& a) {
  std::vector<LabelledBrdf> brdfs{{a.name, brdf_of(find_source(a.name, a.settings))}};
  std::optional<BrdfFile> file;
  if (is_file(a.name)) {
    file = read_brdf_file(a.name);
    brdfs[0].label = std::filesystem::path(a.name).stem().string();
  }
  for (const std::string& text : a.models) {
    const ModelText model = parse_model(text);
    if (file) {
      const ModelChoice choice = choose_for_table(model.name, model.settings, model.mappings, file->table);
      const TableModel on_table(*choice.model, choice.values, file->table, choice.mappings);
      brdfs.push_back({model.label, brdf_of(*choice.model, on_table.row(find_row(file->table, a.settings)))});
      continue;
    }
    const ModelChoice choice = find_model_or_fit(model.name, model.settings);
    if (!model.mappings.empty() || !choice.mappings.empty()) {
      throw Error(ExitCode::usage, "its parameters follow a table's axes, and " + a.name + " is no table", text,
                  "give numbers, or draw against a table");
    }
    brdfs.push_back({model.label, brdf_of(*choice.model, {choice.values.flat().begin(), choice.values.flat().end()})});
  }
  return brdfs;
}

void add_image(CLI::App& plot, Context& context) {
  CLI::App* verb = plot.add_subcommand(
      "image",
      "pi f over theta_h and theta_d, and its ratio to the others' in stops\n"
      "  lobefit plot image gold-metallic-paint.binary --with fit.json --with disney:roughness=0.4 -o image.png\n"
      "  lobefit plot image callisto --set alpha=0.3 --with unreal_default_lit:roughness=0.55 --phi-d 0 -o image.svg");
  verb->fallthrough();
  const auto a = std::make_shared<PlotArguments>();
  const auto options = std::make_shared<ImageSliceOptions>();
  verb->add_option("NAME", a->name, "Table or measured file, reference or model")->required();
  add_repeatable(*verb, "--with", a->models,
                 "Model or fit beside it, NAME or NAME:parameter=value,… (repeatable);\n"
                 "a value SCALE*AXIS^POWER maps a table axis");
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE: of a model or reference a parameter, of a table its row");
  verb->add_option("--phi-d", options->phi_d, "Azimuth of the difference vector in degrees")->capture_default_str();
  verb->add_option("--steps", options->steps, "Cells along each angle")
      ->check(CLI::Range(2, 720))
      ->capture_default_str();
  verb->add_option("--title", a->title, "Title (default: the name)");
  verb->add_option("--width", a->width, "Width in pixels (default: what suits the panels)")
      ->check(CLI::Range(200, 8000));
  verb->add_option("--height", a->height, "Height in pixels")->check(CLI::Range(200, 8000));
  verb->add_option("-o,--output", a->output, "Figure to write, .svg or .png")->required();
  verb->callback([&context, a, options] {
    const std::vector<LabelledBrdf> brdfs = image_slice_brdfs(*a);
    FigureSize size = image_slice_figure_size(brdfs.size());
    if (a->width > 0) size.width = a->width;
    if (a->height > 0) size.height = a->height;
    write_figure(image_slice_figure(brdfs, *options, a->title.empty() ? brdfs[0].label : a->title), a->output,
                 context.force, size);
  });
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
      "  lobefit plot image callisto --set alpha=0.3 --with unreal_default_lit:roughness=0.55 -o image.png\n"
      "  lobefit plot convergence fit.json -o convergence.svg\n"
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
  add_image(*verb, context);
  add_plot_convergence(*verb, context);
  add_plot_pareto(*verb, context);
}

}  // namespace lobefit
