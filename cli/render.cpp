// lobefit render: a reference or a model over a grid, as a table.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/sampling.h"
#include "reference/output_file.h"

namespace lobefit {

void add_render(CLI::App& app, Context& context) {
  CLI::App* verb =
      app.add_subcommand("render",
                         "Render a reference (or a model) over a grid of directions into a table (EXR)\n"
                         "  lobefit render microfacet_diffuse --grid default --axis alpha=0.1,0.5,1 -o truth.exr\n"
                         "GRID: small (9 x 9 x 10), default (18 x 18 x 19), fine (36 x 36 x 37), or a JSON file\n"
                         "  {\"theta_i\":[0,30,60],\"theta_o\":[0,45],\"phi\":[0,90,180]}");
  struct Arguments {
    std::string name, grid = "default", output, facets = "shared";
    std::vector<std::string> settings, axes;
    bool orders = false;
    SamplingArguments sampling;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("NAME", a->name, "Reference or model")->required();
  verb->add_option("--grid", a->grid, "Grid of directions")->capture_default_str();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  add_repeatable(*verb, "--axis", a->axes, "NAME=v1,v2,… makes a parameter an axis of the table (repeatable)");
  verb->add_option("-o,--output", a->output, "Table to write (.exr)")->required();
  verb->add_option("--facets", a->facets,
                   "shared: one facet set for all lights of a line, fast, errors correlated (replicates are kept);\n"
                   "independent: every entry its own")
      ->check(CLI::IsMember({"shared", "independent"}))
      ->capture_default_str();
  verb->add_flag("--orders", a->orders,
                 "Keep the orders of scattering apart: any albedo follows from the table (table recolor)");
  a->sampling.options.samples = 1u << 14;
  a->sampling.add_to(*verb, "per entry");
  verb->callback([&context, a] {
    const std::vector<Axis> axes = parse_axes(a->axes);
    const RenderOptions options{.sampling = a->sampling.checked(context.seed),
                                .exact = a->sampling.exact,
                                .orders = a->orders,
                                .shared_facets = a->facets == "shared"};
    const Reference* reference = find_reference_or_null(a->name);
    const Model* model = reference ? nullptr : &find_model(a->name);
    const Grid grid = Grid::named_or_file(a->grid, reference && reference->sphere);
    ParameterValues values = reference ? reference->defaults() : model->defaults();
    set_parameters(values, a->settings);
    OutputFile file(a->output, context.force);
    const auto monitor = context.monitor();
    Table table = reference ? render(*reference, values, axes, grid, options, *monitor)
                            : render(*model, values, axes, grid, *monitor);
    table.command = context.command;
    table.write(file.temporary());
    file.commit();
    float worst = 0.0f;
    for (const float error : table.stderr_values) worst = std::max(worst, error);
    if (options.sampling.stderr_target > 0.0 && worst > static_cast<float>(options.sampling.stderr_target)) {
      context.say(fmt::format("warning: some entries stopped at {} samples, above the target", most_samples));
    }
    if (context.json) {
      Json description = table.describe();
      description["file"] = a->output;
      description["largest_stderr"] = worst;
      std::cout << description.dump(2) << "\n";
    } else {
      fmt::print("{}: {} entries ({} masked), {}, largest standard error {:.2e} 1/sr\n", a->output, table.entries(),
                 table.masked(), table.method, worst);
    }
  });
}

}  // namespace lobefit
