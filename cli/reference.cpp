// lobefit reference: one pair of directions, by Monte Carlo or quadrature.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/sampling.h"

namespace lobefit {

void add_reference(CLI::App& app, Context& context) {
  CLI::App* verb =
      app.add_subcommand("reference",
                         "Ground truth at one pair of directions, with its standard error\n"
                         "  lobefit reference microfacet_diffuse --set alpha=0.5 --wi 60,0 --wo 60,180 --stderr 1e-5\n"
                         "  lobefit reference microfacet_diffuse --set alpha=0.5 --wi 60,0 --wo 60,0 --exact\n"
                         "  lobefit reference microfacet_diffuse --set bounces=all --wi 60,0 --wo 60,0 --orders");
  struct Arguments {
    std::string name, wi, wo;
    std::vector<std::string> settings;
    bool orders = false;
    SamplingArguments sampling;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("NAME", a->name, "Reference: see `lobefit references`")->required();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  verb->add_option("--wi", a->wi, "Light: THETA,PHI in degrees")->required();
  verb->add_option("--wo", a->wo, "Viewer: THETA,PHI in degrees")->required();
  verb->add_flag("--orders", a->orders,
                 "Also what each order of scattering adds, per unit of albedo to its power (the last: and all beyond)");
  a->sampling.options.samples = 1u << 16;
  a->sampling.add_to(*verb, "in all");
  verb->callback([&context, a] {
    const Reference& reference = find_reference(a->name);
    ParameterValues values = reference.defaults();
    set_parameters(values, a->settings);
    const std::unique_ptr<const Integrator> integrator = reference.make(values);
    const Direction wi = parse_direction(a->wi, "--wi", reference.sphere);
    const Direction wo = parse_direction(a->wo, "--wo", reference.sphere);
    const SamplingOptions options = a->sampling.checked(context.seed);
    if (a->orders && integrator->orders() == 0) {
      throw Error(ExitCode::usage, "these parameters have no orders to keep apart", "--orders", "leave it out");
    }
    Estimate result;
    if (a->sampling.exact) {
      std::vector<double> orders(static_cast<std::size_t>(integrator->orders()));
      integrator->exact_row(wo, {&wi, 1}, {.values = {&result.f, 1}, .orders = orders});
      for (const double order : orders) result.orders.push_back({order, 0.0});
      result.method = "exact";
    } else {
      const auto monitor = context.monitor();
      result = estimate(*integrator, wi, wo, options, monitor.get());
      if (options.stderr_target > 0.0) warn_above_target(context, result, options.stderr_target);
    }
    const int channels = integrator->channels();
    if (context.json) {
      Json json{{"reference", a->name},
                {"params", parameters_json(values)},
                {"wi", parse_numbers(a->wi, "--wi")},
                {"wo", parse_numbers(a->wo, "--wo")},
                {"f", rgb_json(result.f, channels)},
                {"stderr", rgb_json(result.stderr_f, channels)},
                {"samples", result.samples},
                {"method", result.method},
                {"seed", context.seed}};
      if (a->orders) {
        for (const MeanAndError& order : result.orders) {
          json["orders"].push_back({{"f", order.mean}, {"stderr", order.standard_error}});
        }
      }
      std::cout << json.dump(2) << "\n";
    } else if (a->sampling.exact) {
      fmt::print("{:.12g}{}\n", result.f.x,
                 channels == 1 ? "" : fmt::format("  {:.12g}  {:.12g}", result.f.y, result.f.z));
    } else {
      fmt::print("{}  +- {}  ({} samples)\n", rgb_text(result.f, channels), rgb_text(result.stderr_f, channels),
                 result.samples);
    }
    if (a->orders && !context.json) {
      for (std::size_t n = 0; n < result.orders.size(); ++n) {
        const MeanAndError& order = result.orders[n];
        fmt::print("  order {:>2}: {:.12g}{}\n", n + 1, order.mean,
                   a->sampling.exact ? "" : fmt::format("  +- {:.3g}", order.standard_error));
      }
    }
  });
}

}  // namespace lobefit
