// lobefit sample: directions to the light drawn by a model's own importance sampling.
#include <fmt/format.h>

#include <cmath>
#include <iostream>

#include "cli/arguments.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

struct SampleArguments {
  std::string name, wo, output;
  std::vector<std::string> settings;
  std::uint32_t count = 16;
};

struct Sample {
  Direction wi;
  double pdf;
  Rgb f;
};

/// Mean and standard error of f |cos θi|/pdf over independent samples: the directional albedo.
struct AlbedoEstimate {
  Rgb mean{0.0, 0.0, 0.0}, standard_error{0.0, 0.0, 0.0};
};
AlbedoEstimate estimate_albedo(const std::vector<Sample>& samples, bool fibre) {
  Rgb sum{0.0, 0.0, 0.0}, squares{0.0, 0.0, 0.0};
  for (const Sample& sample : samples) {
    if (!(sample.pdf > 0.0)) continue;
    const Rgb weight = sample.f * ((fibre ? 1.0 : std::abs(sample.wi.z)) / sample.pdf);
    sum = sum + weight;
    squares = squares + weight * weight;
  }
  const auto n = static_cast<double>(samples.size());
  const auto deviation = [n](double total, double total_of_squares) {
    const double mean = total / n;
    return n > 1.0 ? std::sqrt(max(total_of_squares / n - mean * mean, 0.0) / (n - 1.0)) : 0.0;
  };
  return {sum * (1.0 / n), {deviation(sum.x, squares.x), deviation(sum.y, squares.y), deviation(sum.z, squares.z)}};
}

double theta_degrees(const Direction& w) { return std::atan2(std::hypot(w.x, w.y), w.z) * 180.0 / pi; }
double phi_degrees(const Direction& w) { return std::atan2(w.y, w.x) * 180.0 / pi; }

}  // namespace

void add_sample(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "sample",
      "Draws directions to the light by a model's own importance sampling, with densities and values\n"
      "Columns: theta_i, phi_i (degrees), pdf (1/sr), r, g, b (the BRDF, 1/sr, without cosine). A direction below the\n"
      "surface of a model that doesn't transmit is a sample lost: its value is 0. Samples are independent, and the mean\n"
      "of f cos(theta_i)/pdf over them all is the directional albedo, told on stderr (with --json: in the document).\n"
      "  lobefit sample callisto --set alpha=0.2 --wo 60,0 -n 1000 -o samples.csv\n"
      "  lobefit sample hair_unreal --wo 90,0 -n 4 --json");
  const auto a = std::make_shared<SampleArguments>();
  verb->add_option("NAME", a->name, "Model (`lobefit models NAME` tells whether it has sampling) or fit file")
      ->required();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  verb->add_option("--wo", a->wo, "Viewer: THETA,PHI in degrees")->required();
  verb->add_option("-n,--samples", a->count, "How many")->check(CLI::Range(1u, 100'000'000u))->capture_default_str();
  verb->add_option("-o,--output", a->output, "File for the CSV result (default: stdout)");
  verb->callback([&context, a] {
    const ModelChoice choice = find_model_or_fit(a->name, a->settings);
    const Model& model = *choice.model;
    const std::string name(model.info->name);
    if (model.sample == nullptr) {
      throw Error(ExitCode::usage, name + " has no importance sampling", "NAME",
                  is_term(model.info->kind) ? "choose a whole BRDF: a term is only a factor"
                                            : "`lobefit models --json` tells which models have it (\"samplable\")");
    }
    if (context.json && !a->output.empty()) {
      throw Error(ExitCode::usage, "-o takes CSV", "-o", "leave out --json, or redirect stdout");
    }
    const bool fibre = is_hair(model.info->kind);
    const Direction wo = parse_direction(a->wo, "--wo", fibre);
    const auto flat = choice.values.flat();
    const SamplePoints points(Sampler::philox, {context.seed, 0, 0});
    std::vector<Sample> samples(a->count);
    for (std::uint32_t i = 0; i < a->count; ++i) {
      const Direction wi = model.sample(flat, wo, points(i));
      samples[i] = {wi, model.pdf(flat, wi, wo), model.evaluate(flat, wi, wo)};
    }
    const AlbedoEstimate albedo = estimate_albedo(samples, fibre);
    if (context.json) {
      Json list = Json::array();
      for (const Sample& s : samples) {
        list.push_back(
            {{"wi", {theta_degrees(s.wi), phi_degrees(s.wi)}}, {"pdf", s.pdf}, {"f", {s.f.x, s.f.y, s.f.z}}});
      }
      std::cout << Json{{"model", name},
                        {"params", parameters_json(choice.values)},
                        {"wo", parse_numbers(a->wo, "--wo")},
                        {"samples", list},
                        {"albedo", {albedo.mean.x, albedo.mean.y, albedo.mean.z}},
                        {"stderr", {albedo.standard_error.x, albedo.standard_error.y, albedo.standard_error.z}}}
                       .dump(2)
                << "\n";
      return;
    }
    std::string text = "theta_i,phi_i,pdf,r,g,b\n";
    for (const Sample& s : samples) {
      text += fmt::format("{},{},{},{},{},{}\n", theta_degrees(s.wi), phi_degrees(s.wi), s.pdf, s.f.x, s.f.y, s.f.z);
    }
    write_or_print(text, a->output, context.force);
    context.say(fmt::format("directional albedo by these samples: {} ± {}", rgb_text(albedo.mean, 3),
                            rgb_text(albedo.standard_error, 3)));
  });
}

}  // namespace lobefit
