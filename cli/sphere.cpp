// lobefit sphere: a lit sphere of anything that has a BRDF.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "report/image.h"
#include "report/sphere.h"

namespace lobefit {

namespace {

struct SphereArguments {
  std::string name, output, light, lighting = "environment";
  std::vector<std::string> settings;
  SphereOptions options{.size = 256, .antialiasing = 2};
  double exposure = 0.0;
};

Lighting lighting_of(const SphereArguments& a) {
  if (a.light.empty()) return find_lighting(a.lighting);
  const std::vector<double> angles = parse_numbers(a.light, "--light");
  if (angles.size() != 2) {
    throw Error(ExitCode::usage, fmt::format("expected two angles, got {}", angles.size()), "--light",
                "write THETA,PHI in degrees");
  }
  return Lighting::directional(angles[0], angles[1]);
}

/// What lacks a value leaves a hole; a reference without quadrature is an error.
SphereBrdf brdf_of(const Source& source) {
  if (source.integrator) {
    if (!source.integrator->has_exact()) {
      throw Error(ExitCode::usage, "the reference is known by Monte Carlo alone", source.label,
                  "render a table of it, and give that");
    }
    return [&source](const Direction& wi, const Direction& wo) { return std::optional<Rgb>(source.evaluate(wi, wo)); };
  }
  return [&source](const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    try {
      return source.evaluate(wi, wo);
    } catch (const Error&) {
      return std::nullopt;
    }
  };
}

}  // namespace

void add_sphere(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "sphere",
      "A lit sphere of a model, a reference or a file\n"
      "  lobefit sphere callisto --set alpha=0.3 -o sphere.png\n"
      "  lobefit sphere aurora_white_rgb.bsdf --light 60,135 --exposure 1 -o sphere.exr\n"
      "Orthographic, viewed along the axis; a white Lambertian surface that faces a light has radiance 1. A file's\n"
      "sphere is black where the file has no value. EXR is linear, PNG 8-bit sRGB.");
  const auto a = std::make_shared<SphereArguments>();
  verb->add_option("NAME", a->name, "Model, reference or table file")->required();
  verb->add_option("-o,--output", a->output, "Picture to write, .png or .exr")->required();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  auto* light = verb->add_option("--light", a->light,
                                 "One directional light: THETA from the viewer and PHI from the right over the top, in "
                                 "degrees");
  verb->add_option("--lighting", a->lighting, "Instead: directional (45,135), three_lights, environment")
      ->capture_default_str()
      ->excludes(light);
  verb->add_option("--size", a->options.size, "Pixels across")->check(CLI::Range(1, 8192))->capture_default_str();
  verb->add_option("--exposure", a->exposure, "Stops: 1 doubles the radiance")
      ->check(CLI::Range(-64.0, 64.0))
      ->capture_default_str();
  verb->callback([&context, a] {
    const Source source = find_source(a->name, a->settings);
    if (source.fibre || source.sphere) {
      throw Error(ExitCode::usage, "a sphere shows what an opaque surface reflects", a->name,
                  "choose a model of kind brdf that does not transmit");
    }
    const Lighting lighting = lighting_of(*a);
    SphereOptions options = a->options;
    options.isotropic = source.isotropic;
    const SphereBrdf brdf = brdf_of(source);
    write_picture(render_spheres({&brdf, 1}, lighting, options).front(), a->exposure, a->output, context.force);
    if (context.json) {
      std::cout << Json{{"file", a->output},
                        {"model", source.label},
                        {"params", source.parameters},
                        {"lighting", a->light.empty() ? a->lighting : "light " + a->light},
                        {"size", options.size},
                        {"exposure", a->exposure}}
                       .dump(2)
                << "\n";
    } else {
      fmt::print("{}\n", a->output);
    }
  });
}

}  // namespace lobefit
