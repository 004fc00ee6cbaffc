// lobefit render: a reference or a model over a grid, as a table.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/sampling.h"
#include "cli/table_file.h"

namespace lobefit {

namespace {

/// Says how many entries missed the target.
void warn_about_targets(const Context& context, const Table& table) {
  if (table.stderr_target <= 0.0) return;
  std::size_t above = 0;
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    float error = 0.0f;
    for (int c = 0; c < table.channels; ++c) error = std::max(error, table.standard_error(entry, c));
    if (table.valid[entry] && error > static_cast<float>(table.stderr_target)) ++above;
  }
  if (above > 0) {
    context.say(fmt::format("warning: {} of {} entries stopped at {} samples, above the target", above, table.entries(),
                            most_samples));
  }
}

}  // namespace

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
    bool orders = false, resume = false;
    std::string shard;
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
                   "independent: every entry its own. --stderr doubles the samples per line or per entry")
      ->check(CLI::IsMember({"shared", "independent"}))
      ->capture_default_str();
  verb->add_flag("--orders", a->orders,
                 "Keep the orders of scattering apart: any albedo follows from the table (table recolor)");
  verb->add_flag("--resume", a->resume,
                 "Go on with the finished lines that an interrupted run kept in OUTPUT.part; the same file results");
  const CLI::Option* shard = verb->add_option(
      "--shard", a->shard,
      "I/N: only the I-th of N parts of the lines, to be joined with `table merge`; the others are masked");
  a->sampling.options.samples = 1u << 14;
  a->sampling.add_to(*verb, "per entry");
  verb->callback([&context, a, shard] {
    const std::vector<Axis> axes = parse_axes(a->axes);
    const RenderOptions options{.sampling = a->sampling.checked(context.seed),
                                .exact = a->sampling.exact,
                                .orders = a->orders,
                                .shared_facets = a->facets == "shared"};
    const Reference* reference = find_reference_or_null(a->name);
    const Model* model = reference ? nullptr : &find_model(a->name);
    const Grid grid = Grid::named_or_file(a->grid, reference ? reference->sphere : is_hair(model->info->kind));
    ParameterValues values = reference ? reference->defaults() : model->defaults();
    set_parameters(values, a->settings);
    const Shards shards = shard->count() > 0 ? Shards::parse(a->shard, "--shard") : Shards{};
    const auto monitor = context.monitor();
    const Table table = render_into(a->output, a->resume, shards, context, [&](const RenderJob& job) {
      return reference ? render(*reference, values, axes, grid, options, *monitor, job)
                       : render(*model, values, axes, grid, *monitor, job);
    });
    warn_about_targets(context, table);
    float worst = 0.0f;
    for (std::size_t slot = 0; slot < table.stderr_values.size(); ++slot) {
      if (table.valid[slot % table.entries()]) worst = std::max(worst, table.stderr_values[slot]);
    }
    if (context.json) {
      Json description = table.describe();
      description["file"] = a->output;
      description["largest_stderr"] = worst;
      description["failed"] = table.failed().size();
      std::cout << description.dump(2) << "\n";
    } else {
      fmt::print("{}: {} entries ({} masked), {}{}, largest standard error {:.2e} 1/sr\n", a->output, table.entries(),
                 table.masked(), table.shards.count > 1 ? "shard " + table.shards.text() + ", " : "", table.method,
                 worst);
    }
  });
}

}  // namespace lobefit
