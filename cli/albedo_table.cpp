// lobefit albedo-table: directional albedos of a rough interface over angle and roughness.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "reference/estimate.h"
#include "reference/output_file.h"
#include "reference/specular/albedo_table.h"
#include "reference/specular/microfacet_specular.h"

namespace lobefit {

namespace {

/// Centres of `size` equal cells of [0, 1].
std::vector<double> cell_centres(int size) {
  std::vector<double> centres;
  for (int k = 0; k < size; ++k) centres.push_back((k + 0.5) / size);
  return centres;
}

AlbedoTableOptions table_options(const ParameterValues& values) {
  const auto p = unflatten<MicrofacetSpecular, double>(values.flat());
  const ParameterValues defaults(values.list(), values.owner());
  for (const char* name : {"alpha", "alpha_x", "alpha_y", "orientation"}) {
    if (values.get(name) != defaults.get(name)) {
      throw Error(ExitCode::usage, "the table sets the roughness, the same in all azimuths", name,
                  "give the list --alpha instead");
    }
  }
  return {.distribution = static_cast<Distribution>(p.distribution),
          .masking = static_cast<InterfaceMasking>(p.masking),
          .reflectance = p.interface == 0.0   ? FacetReflectance::schlick(p.f0, p.f90)
                         : p.interface == 1.0 ? FacetReflectance::conductor(p.eta, p.k)
                                              : FacetReflectance::dielectric(p.ior),
          .bounces = p.bounces == 0.0 ? 1 : RoughInterface::all_bounces,
          .mu = {},
          .alpha = {}};
}

}  // namespace

void add_albedo_table(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "albedo-table",
      "Directional albedos E(mu, alpha) of microfacet_specular, for energy compensation (JSON)\n"
      "  lobefit albedo-table --size 32 -o ggx.json                      E, its F0/F90 split, E_avg\n"
      "  lobefit albedo-table --set interface=dielectric --set ior=1.5 --set bounces=all\n"
      "                       --mu 0.1,0.5,1 --alpha 0.1,0.5 -o glass.json");
  struct Arguments {
    std::vector<std::string> settings;
    std::string mu, alpha, output;
    int size = 16;
    std::uint64_t samples = 1u << 16;
  };
  const auto a = std::make_shared<Arguments>();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE of microfacet_specular, but for the roughness (repeatable)");
  verb->add_option("--size", a->size, "Cells along mu and alpha; entries are at their centres")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  verb->add_option("--mu", a->mu, "Instead: the cosines v1,v2,… in (0, 1]");
  verb->add_option("--alpha", a->alpha, "Instead: the alphas v1,v2,… in [1e-4, 1]");
  verb->add_option("--samples", a->samples, "Walks per entry, for bounces=all")
      ->check(CLI::Range(std::uint64_t{replicate_count}, most_samples))
      ->capture_default_str();
  verb->add_option("-o,--output", a->output, "File to write (.json)");
  verb->callback([&context, a] {
    if (a->output.empty() && !context.json) {
      throw Error(ExitCode::usage, "nowhere to write", "--output", "give -o FILE, or --json for standard output");
    }
    ParameterValues values(describe_parameters<MicrofacetSpecular>(), std::string(MicrofacetSpecular::name));
    set_parameters(values, a->settings);
    AlbedoTableOptions options = table_options(values);
    options.mu = a->mu.empty() ? cell_centres(a->size) : parse_numbers(a->mu, "--mu");
    options.alpha = a->alpha.empty() ? cell_centres(a->size) : parse_numbers(a->alpha, "--alpha");
    options.samples = a->samples;
    options.seed = context.seed;
    std::optional<OutputFile> file;
    if (!a->output.empty()) file.emplace(a->output, context.force);
    const auto monitor = context.monitor();
    const AlbedoTable table = make_albedo_table(options, *monitor);
    Json parameters = parameters_json(values);
    for (const char* name : {"alpha", "alpha_x", "alpha_y", "orientation"}) parameters.erase(name);
    const std::string text = table.json(parameters, context.command).dump(1) + "\n";
    if (file) {
      file->write(text);
      file->commit();
    }
    if (context.json) {
      std::cout << text;
      return;
    }
    for (const AlbedoColumn& column : table.columns) {
      fmt::print("{:18} {} x {}, from {:.6f} to {:.6f}, largest error {:.1e}\n", column.name, options.alpha.size(),
                 options.mu.size(), *std::min_element(column.value.begin(), column.value.end()),
                 *std::max_element(column.value.begin(), column.value.end()),
                 *std::max_element(column.error.begin(), column.error.end()));
    }
  });
}

}  // namespace lobefit
