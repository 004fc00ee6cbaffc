// lobefit sphere: a lit sphere of anything that has a BRDF.
#include <fmt/format.h>

#include <cmath>
#include <iostream>
#include <limits>

#include "cli/arguments.h"
#include "reference/output_file.h"
#include "report/flip.h"
#include "report/image.h"
#include "report/image_difference.h"
#include "report/sphere.h"

namespace lobefit {

namespace {

struct SphereArguments {
  std::string name, output, light, area, environment, lighting = "environment", against, difference;
  std::vector<std::string> settings, against_settings;
  SphereOptions options{.size = 256, .antialiasing = 2};
  double exposure = 0.0, rotation = 0.0;
};

std::vector<double> angles(const std::string& text, const char* option, std::size_t count, const char* form) {
  const std::vector<double> numbers = parse_numbers(text, option);
  if (numbers.size() != count) {
    throw Error(ExitCode::usage, fmt::format("expected {} angles, got {}", count, numbers.size()), option,
                fmt::format("write {} in degrees", form));
  }
  return numbers;
}

Lighting lighting_of(const SphereArguments& a) {
  if (!a.environment.empty()) {
    return {.sampled = std::make_shared<EnvironmentMap>(read_environment(a.environment, a.rotation))};
  }
  if (!a.area.empty()) {
    const std::vector<double> disk = angles(a.area, "--area", 3, "THETA,PHI,RADIUS");
    return {.sampled = std::make_shared<DiskLight>(disk[0], disk[1], disk[2])};
  }
  if (a.light.empty()) return find_lighting(a.lighting);
  const std::vector<double> light = angles(a.light, "--light", 2, "THETA,PHI");
  return Lighting::directional(light[0], light[1]);
}

std::string lighting_text(const SphereArguments& a) {
  return !a.environment.empty() ? a.environment
         : !a.area.empty()      ? "area " + a.area
         : a.light.empty()      ? a.lighting
                                : "light " + a.light;
}

LightProposal proposal_of(const Source& source) {
  if (!source.model || !source.model->sample) return any_lobe_proposal();
  return {
      .sample = [&source](const Direction& wo,
                          const std::array<double, 2>& u) { return source.model->sample(source.flat, wo, u); },
      .pdf = [&source](const Direction& wi, const Direction& wo) { return source.model->pdf(source.flat, wi, wo); }};
}

Source opaque_source(const std::string& name, const std::vector<std::string>& settings) {
  Source source = find_source(name, settings);
  if (source.fibre || source.sphere) {
    throw Error(ExitCode::usage, "a sphere shows what an opaque surface reflects", name,
                "choose a model of kind brdf that does not transmit");
  }
  return source;
}

/// Standard error of pixels over their mean, root mean square over the sphere; 0 where nothing was drawn.
double relative_noise(const SphereImage& image) {
  double square_sum = 0.0, sum = 0.0;
  std::size_t count = 0;
  for (std::size_t pixel = 0; pixel < image.noise.size(); ++pixel) {
    if (image.cover[pixel] < 1.0f) continue;
    square_sum += square(static_cast<double>(image.noise[pixel]));
    for (std::size_t c = 0; c < 3; ++c) sum += image.rgb[3 * pixel + c] / 3.0;
    ++count;
  }
  return sum > 0.0 ? std::sqrt(square_sum * static_cast<double>(count)) / sum : 0.0;
}

/// a - b as an EXR, or ꟻLIP's errors in false colours.
void write_difference(const SphereImage& a, const SphereImage& b, const std::string& path, bool force) {
  if (path.ends_with(".exr")) {
    SphereImage difference = a;
    for (std::size_t k = 0; k < a.rgb.size(); ++k) difference.rgb[k] -= b.rgb[k];
    write_picture(difference, 0.0, path, force);
    return;
  }
  const std::vector<double> errors = flip_errors(a.rgb, b.rgb, a.size, a.size, pixels_per_degree);
  std::vector<float> values(errors.size());
  for (std::size_t pixel = 0; pixel < errors.size(); ++pixel) {
    values[pixel] = a.cover[pixel] > 0.0f && b.cover[pixel] > 0.0f ? static_cast<float>(errors[pixel])
                                                                   : std::numeric_limits<float>::quiet_NaN();
  }
  write_false_colour(values, static_cast<std::size_t>(a.size), static_cast<std::size_t>(a.size), path, force);
}

/// Refused now rather than after the work.
void check_outputs(const SphereArguments& a, bool force) {
  if (!a.difference.empty() && a.against.empty()) {
    throw Error(ExitCode::usage, "a difference needs two spheres", "--difference", "give the other one to --against");
  }
  for (const std::string& path : {a.output, a.difference}) {
    if (path.empty()) continue;
    check_picture_extension(path);
    OutputFile(path, force);
  }
}

}  // namespace

void add_sphere(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "sphere",
      "A lit sphere of a model, a reference or a file\n"
      "  lobefit sphere callisto --set alpha=0.3 -o sphere.png\n"
      "  lobefit sphere aurora_white_rgb.bsdf --light 60,135 --exposure 1 -o sphere.exr\n"
      "  lobefit sphere callisto --environment studio.exr --rotate 90 --size 512 -o sphere.png\n"
      "  lobefit sphere proxima --set alpha=1 --against eon --difference flip.png -o sphere.png\n"
      "Orthographic, viewed along the axis; a white Lambertian surface that faces a light has radiance 1. A file's\n"
      "sphere is black where the file has no value. EXR is linear, PNG 8-bit sRGB.\n"
      "An environment is a lat-long picture as OpenEXR has them: its middle column is behind the camera.");
  const auto a = std::make_shared<SphereArguments>();
  verb->add_option("NAME", a->name, "Model, reference or table file")->required();
  verb->add_option("-o,--output", a->output, "Picture to write, .png or .exr")->required();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  auto* light = verb->add_option("--light", a->light,
                                 "One directional light: THETA from the viewer and PHI from the right over the top, in "
                                 "degrees");
  auto* area =
      verb->add_option("--area", a->area, "Instead: a disk of light, THETA,PHI,RADIUS in degrees")->excludes(light);
  auto* environment = verb->add_option("--environment", a->environment,
                                       "Instead: a lat-long picture, .exr, .hdr or any that OpenImageIO reads")
                          ->excludes(light)
                          ->excludes(area);
  verb->add_option("--rotate", a->rotation, "Degrees by which the picture turns to the right")->needs(environment);
  verb->add_option("--lighting", a->lighting, "Instead: directional (45,135), three_lights, environment")
      ->capture_default_str()
      ->excludes(light)
      ->excludes(area)
      ->excludes(environment);
  verb->add_option("--samples", a->options.light_samples,
                   "Per pixel, of an area light or an environment, and as many of the surface's lobes")
      ->check(CLI::Range(2, 1 << 20))
      ->capture_default_str();
  verb->add_option("--against", a->against, "Another model, reference or table file under the same light");
  add_repeatable(*verb, "--against-set", a->against_settings, "As --set, for the other one");
  verb->add_option("--difference", a->difference,
                   "Picture of the difference: .exr is NAME less the other, .png the error that FLIP sees, in false "
                   "colours from its least to its largest");
  verb->add_option("--size", a->options.size, "Pixels across")->check(CLI::Range(1, 8192))->capture_default_str();
  verb->add_option("--exposure", a->exposure, "Stops: 1 doubles the radiance")
      ->check(CLI::Range(-64.0, 64.0))
      ->capture_default_str();
  verb->callback([&context, a] {
    check_outputs(*a, context.force);
    std::vector<Source> sources{opaque_source(a->name, a->settings)};
    if (!a->against.empty()) sources.push_back(opaque_source(a->against, a->against_settings));
    const Lighting lighting = lighting_of(*a);
    SphereOptions options = a->options;
    options.seed = context.seed;
    std::vector<SphereBrdf> brdfs;
    for (const Source& source : sources) {
      brdfs.push_back(brdf_of(source));
      options.proposals.push_back(proposal_of(source));
      options.isotropic = options.isotropic && source.isotropic;
    }
    const auto monitor = context.monitor();
    const std::vector<SphereImage> images = render_spheres(brdfs, lighting, options, *monitor);
    write_picture(images[0], a->exposure, a->output, context.force);
    Json result{{"file", a->output},
                {"model", sources[0].label},
                {"params", sources[0].parameters},
                {"lighting", lighting_text(*a)},
                {"size", options.size},
                {"exposure", a->exposure}};
    std::string text = a->output + "\n";
    if (lighting.sampled) {
      result["noise"] = relative_noise(images[0]);
      text += fmt::format("  noise {:.2g} of the mean radiance, rms over pixels\n", relative_noise(images[0]));
    }
    if (images.size() > 1) {
      const std::optional<ImageDifference> difference = image_difference(images[0], images[1]);
      if (!difference) {
        throw Error(ExitCode::failure, "no pixel shows both spheres", a->against, "choose a larger --size");
      }
      result["against"] = {{"model", sources[1].label},
                           {"params", sources[1].parameters},
                           {"delta_e_itp_mean", difference->delta_e_itp_mean},
                           {"delta_e_itp_p95", difference->delta_e_itp_p95},
                           {"flip_mean", difference->flip_mean}};
      text += fmt::format("  against {}: delta E_ITP {:.3g} mean, {:.3g} at 95 %; FLIP {:.3g} mean\n", sources[1].label,
                          difference->delta_e_itp_mean, difference->delta_e_itp_p95, difference->flip_mean);
      if (!a->difference.empty()) {
        write_difference(images[0], images[1], a->difference, context.force);
        result["against"]["difference"] = a->difference;
        text += "  " + a->difference + "\n";
      }
    }
    if (context.json) {
      std::cout << result.dump(2) << "\n";
    } else {
      fmt::print("{}", text);
    }
  });
}

}  // namespace lobefit
