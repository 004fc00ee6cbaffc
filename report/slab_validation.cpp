#include "report/slab_validation.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <mutex>

#include "reference/json_reader.h"
#include "reference/substrate/tree_albedo.h"
#include "report/chart.h"
#include "report/image_difference.h"

namespace lobefit {

namespace {

constexpr double log_scale = 20.0, smallest_albedo = 0.01;
constexpr std::array view_angles{2.0, 30.0, 50.0, 65.0, 78.0};
constexpr std::array light_angles{2.0, 15.0, 30.0, 45.0, 60.0, 75.0};
constexpr std::array light_azimuths{0.0, 45.0, 90.0, 135.0, 165.0, 180.0};
/// Cosine of the half vector's angle from the normal beyond which a smooth interface's mirror image would be counted:
/// the truth has a delta function there.
constexpr double mirror_cosine = 0.99;

constexpr int sphere_size = 32;
constexpr const char* sphere_lighting = "three_lights";

std::array<double, 6> key(const Direction& wi, const Direction& wo) { return {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z}; }

std::array<double, 3> channels(const Rgb& c) { return {c.x, c.y, c.z}; }

bool has_smooth_interface(const SlabTree& tree) {
  return std::any_of(tree.nodes.begin(), tree.nodes.end(), [](const TreeNode& node) {
    return node.kind == Operator::slab && largest_channel(node.slab.f0) > 0.0 && square(node.slab.roughness) < 0.004;
  });
}

}  // namespace

double TreeErrors::error() const {
  return std::sqrt(0.5 * (brdf_rms_log * brdf_rms_log + albedo_rms_relative * albedo_rms_relative));
}

Json TreeErrors::json() const {
  Json json{{"error", error()},
            {"brdf_rms_log", brdf_rms_log},
            {"brdf_mean_relative", brdf_mean_relative},
            {"albedo_rms_relative", albedo_rms_relative},
            {"albedo_largest_relative", albedo_largest_relative}};
  if (sphere_delta_e_itp >= 0.0) json["sphere_delta_e_itp"] = sphere_delta_e_itp;
  return json;
}

TreeJudge::TreeJudge(SlabTree tree, const FittedBlend::Constants<double>& constants, const ValidationOptions& options,
                     Monitor& monitor)
    : tree_(std::move(tree)), constants_(constants), options_(options) {
  for (const double theta : view_angles) views_.push_back(direction(radians(theta), 0.0));
  for (const double theta : light_angles) {
    for (const double phi : light_azimuths) lights_.push_back(direction(radians(theta), radians(phi)));
  }
  smooth_ = has_smooth_interface(resolved(tree_));
  full_ = shown({}, 24);

  const PhysicalSurface matter(tree_, options.reading);
  // Replicates: their spread is the error of the mean.
  const std::uint32_t brdf_samples = static_cast<std::uint32_t>(options.brdf_samples / replicate_count);
  const std::uint32_t albedo_paths = static_cast<std::uint32_t>(options.albedo_paths / replicate_count);
  const std::size_t tasks = views_.size() * replicate_count;
  std::vector<View> parts(tasks);
  monitor.begin("layered integrator", tasks);
  tbb::parallel_for(std::size_t{0}, tasks, [&](std::size_t task) {
    monitor.check();
    const std::size_t v = task / replicate_count;
    View& part = parts[task];
    part.brdf.resize(lights_.size());
    const SamplePoints rows(Sampler::sobol, {options.seed, v, static_cast<std::uint32_t>(task % replicate_count)});
    const SamplePoints paths(Sampler::sobol,
                             {options.seed, v + views_.size(), static_cast<std::uint32_t>(task % replicate_count)});
    matter.sample_row(views_[v], lights_, rows, std::max(brdf_samples, 1u), false, {.values = part.brdf});
    part.albedo = matter.sample_albedo(views_[v], paths, std::max(albedo_paths, 1u));
    monitor.advance(1);
  });
  monitor.end();
  double squares = 0.0;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    View view{views_[v], std::vector<Rgb>(lights_.size(), Rgb{0.0, 0.0, 0.0}), {0.0, 0.0, 0.0}};
    std::array<std::vector<double>, 3> replicates;
    for (std::size_t k = 0; k < replicate_count; ++k) {
      const View& part = parts[v * replicate_count + k];
      for (std::size_t l = 0; l < lights_.size(); ++l) {
        view.brdf[l] = view.brdf[l] + part.brdf[l] * (1.0 / replicate_count);
      }
      view.albedo = view.albedo + part.albedo * (1.0 / replicate_count);
      for (std::size_t c = 0; c < 3; ++c) replicates[c].push_back(channels(part.albedo)[c]);
    }
    for (const std::vector<double>& channel : replicates) {
      const MeanAndError estimate = mean_and_error(std::span<const double>(channel));
      squares += square(estimate.standard_error / std::max(estimate.mean, smallest_albedo));
    }
    truth_.push_back(std::move(view));
  }
  truth_error_ = std::sqrt(squares / static_cast<double>(3 * views_.size()));
  if (options.spheres) render_matter_sphere(matter, monitor);
}

void TreeJudge::render_matter_sphere(const PhysicalSurface& matter, Monitor& monitor) {
  // Which pairs the pixels ask for does not depend on the BRDF: they are noted first, and rendered together.
  std::mutex noting;
  const SphereBrdf note = [&](const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    const std::lock_guard lock(noting);
    matter_[key(wi, wo)] = {};
    return Rgb{0.0, 0.0, 0.0};
  };
  render_spheres({&note, 1}, find_lighting(sphere_lighting), {.size = sphere_size});

  std::vector<std::pair<const std::array<double, 6>, std::array<Rgb, 2>>*> pairs;
  for (auto& pair : matter_) pairs.push_back(&pair);
  const auto samples = static_cast<std::uint32_t>(std::max<std::uint64_t>(options_.brdf_samples / 8, 1));
  monitor.begin("layered integrator, sphere", pairs.size());
  tbb::parallel_for(std::size_t{0}, pairs.size(), [&](std::size_t i) {
    monitor.check();
    const std::array<double, 6>& at = pairs[i]->first;
    const Direction wi{at[0], at[1], at[2]}, wo{at[3], at[4], at[5]};
    for (std::uint32_t half = 0; half < 2; ++half) {
      const SamplePoints points(Sampler::sobol, {options_.seed, i + 2 * views_.size(), half});
      matter.sample_row(wo, {&wi, 1}, points, samples, false, {.values = {&pairs[i]->second[half], 1}});
    }
    monitor.advance(1);
  });
  monitor.end();
  sphere_truth_error_ = 0.5 * std::max(sphere_difference(matter_brdf(1.0), matter_brdf(0.0)), 0.0);
}

SphereBrdf TreeJudge::matter_brdf(double first_half) const {
  return [this, first_half](const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    // A smooth interface's mirror image is a delta function to matter, and a narrow lobe to slabs.
    if (smooth_ && normalize(wi + wo).z > mirror_cosine) return {};
    const std::array<Rgb, 2>& halves = matter_.at(key(wi, wo));
    return halves[0] * first_half + halves[1] * (1.0 - first_half);
  };
}

SphereBrdf TreeJudge::brdf_of(std::span<const SimplifyStep> steps) const {
  return [this, steps](const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    return evaluate(walk(simplified(tree_, steps, {constants_, wo.z})), wi, wo);
  };
}

double TreeJudge::sphere_difference(const SphereBrdf& a, const SphereBrdf& b) const {
  const std::array<SphereBrdf, 2> brdfs{a, b};
  const std::vector<SphereImage> images = render_spheres(brdfs, find_lighting(sphere_lighting), {.size = sphere_size});
  const auto difference = image_difference(images[0], images[1]);
  return difference ? difference->delta_e_itp_mean : -1.0;
}

std::vector<TreeJudge::View> TreeJudge::shown(std::span<const SimplifyStep> steps, int albedo_steps,
                                              const WalkOptions& walk_options) const {
  std::vector<View> result;
  for (const Direction& wo : views_) {
    const std::vector<Closure> closures = walk(simplified(tree_, steps, {constants_, wo.z}), walk_options);
    View view{wo, {}, directional_albedo(closures, wo, albedo_steps)};
    for (const Direction& wi : lights_) view.brdf.push_back(evaluate(closures, wi, wo));
    result.push_back(std::move(view));
  }
  return result;
}

TreeErrors TreeJudge::compare(const std::vector<View>& shown, const std::vector<View>& truth) const {
  TreeErrors errors;
  double squares = 0.0, difference = 0.0, total = 0.0, albedo_squares = 0.0;
  std::size_t count = 0;
  for (std::size_t v = 0; v < truth.size(); ++v) {
    for (std::size_t l = 0; l < lights_.size(); ++l) {
      if (smooth_ && normalize(lights_[l] + truth[v].wo).z > mirror_cosine) continue;
      const auto a = channels(shown[v].brdf[l]), b = channels(truth[v].brdf[l]);
      for (std::size_t c = 0; c < 3; ++c) {
        const double cosine = lights_[l].z, x = cosine * std::max(a[c], 0.0), y = cosine * std::max(b[c], 0.0);
        squares += square(std::log1p(log_scale * x) - std::log1p(log_scale * y));
        difference += std::abs(x - y);
        total += y;
        ++count;
      }
    }
    const auto a = channels(shown[v].albedo), b = channels(truth[v].albedo);
    for (std::size_t c = 0; c < 3; ++c) {
      const double relative = std::abs(a[c] - b[c]) / std::max(b[c], smallest_albedo);
      albedo_squares += square(relative);
      errors.albedo_largest_relative = std::max(errors.albedo_largest_relative, relative);
    }
  }
  errors.brdf_rms_log = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(count, 1)));
  errors.brdf_mean_relative = difference / std::max(total, 1e-12);
  errors.albedo_rms_relative = std::sqrt(albedo_squares / static_cast<double>(3 * truth.size()));
  return errors;
}

TreeErrors TreeJudge::model(std::span<const SimplifyStep> steps) const {
  TreeErrors errors = compare(shown(steps, 24), truth_);
  if (!options_.spheres) return errors;
  errors.sphere_delta_e_itp = sphere_difference(matter_brdf(0.5), brdf_of(steps));
  return errors;
}

TreeJudge::ExactStatistics TreeJudge::exact_statistics() const {
  const WalkOptions exact{.exact_statistics = true};
  const std::vector<View> apart = shown({}, 24, exact);
  return {walk(tree_, exact).size(), compare(full_, apart), compare(apart, truth_)};
}

double TreeJudge::quick_error(std::span<const SimplifyStep> steps) const {
  return compare(shown(steps, 12), truth_).error();
}

TreeErrors TreeJudge::simplification(std::span<const SimplifyStep> steps) const {
  TreeErrors errors = compare(shown(steps, 24), full_);
  if (!options_.spheres) return errors;
  errors.sphere_delta_e_itp = sphere_difference(brdf_of({}), brdf_of(steps));
  return errors;
}

const ValidatedStage* ValidatedStrategy::best(int bytes) const {
  const ValidatedStage* found = nullptr;
  for (const ValidatedStage& stage : stages) {
    if (stage.stage.bytes <= bytes && (!found || stage.model.error() < found->model.error())) found = &stage;
  }
  return found;
}

SlabValidation validate_tree(const SlabTree& tree, const FittedBlend::Constants<double>& constants,
                             const ValidationOptions& options, Monitor& monitor) {
  const TreeJudge judge(tree, constants, options, monitor);
  SlabValidation validation{.notes = physical_notes(tree),
                            .truth_error = judge.truth_error(),
                            .sphere_truth_error = judge.sphere_truth_error(),
                            .tree = tree,
                            .exact = judge.exact_statistics()};
  std::vector<std::pair<std::string, std::vector<SimplifiedTree>>> ways{
      {"baseline", simplify_deepest_first(tree, BlendRule::baseline, constants)},
      {"fitted", simplify_deepest_first(tree, BlendRule::fitted, constants)},
      {"error_driven", simplify_by_error(tree, constants, [&](std::span<const SimplifyStep> steps) {
         monitor.check();
         return judge.quick_error(steps);
       })}};
  for (auto& [name, stages] : ways) {
    ValidatedStrategy strategy{name, std::vector<ValidatedStage>(stages.size())};
    tbb::parallel_for(std::size_t{0}, stages.size(), [&](std::size_t i) {
      monitor.check();
      const std::vector<SimplifyStep>& steps = stages[i].steps;
      strategy.stages[i] = {stages[i], judge.simplification(steps), judge.model(steps)};
      strategy.stages[i].stage.error = strategy.stages[i].model.error();
    });
    validation.strategies.push_back(std::move(strategy));
  }
  return validation;
}

// ---- telling -------------------------------------------------------------------------------------------------------

namespace {

std::string sphere_text(const TreeErrors& errors) {
  return errors.sphere_delta_e_itp < 0.0 ? "" : fmt::format("{:.2f}", errors.sphere_delta_e_itp);
}

Json stage_json(const SlabTree& tree, const ValidatedStage& stage) {
  const SlabTree nodes = collapsible(tree);
  Json collapsed = Json::array(), steps = Json::array();
  for (const SimplifyStep& step : stage.stage.steps) {
    steps.push_back(step_text(tree, step));
    if (step.index >= 0) collapsed.push_back(nodes.node(step.index).path);
  }
  return {{"bytes", stage.stage.bytes},
          {"closures", stage.stage.closures},
          {"collapsed", collapsed},
          {"steps", steps},
          {"simplification", stage.simplification.json()},
          {"model", stage.model.json()}};
}

}  // namespace

Json SlabValidation::json(const Json& provenance) const {
  Json json{{"title", tree.title}};
  Json all = Json::object();
  for (const ValidatedStrategy& strategy : strategies) {
    Json stages = Json::array();
    for (const ValidatedStage& stage : strategy.stages) stages.push_back(stage_json(tree, stage));
    if (strategy.name == "fitted") json["levels"] = stages;
    all[strategy.name] = stages;
  }
  json["strategies"] = all;
  json["exact_statistics"] = {
      {"closures", exact.closures}, {"difference", exact.difference.json()}, {"model", exact.model.json()}};
  json["truth_error"] = truth_error;
  json["sphere_truth_error"] = sphere_truth_error;
  json["notes"] = notes;
  json["provenance"] = provenance;
  return json;
}

std::string SlabValidation::page(const std::string& title, const std::string& command) const {
  std::string page = "# " + title + "\n\nMade by `" + command + "`, lobefit " LOBEFIT_VERSION ".\n\n";
  page +=
      "**Simplification** is the error against the full tree, **model** that against the layers as matter (layered "
      "integrator";
  page += fmt::format(
      ", whose albedos are known to {:.2g} relative). error: rms of the two next columns. brdf: rms of the difference "
      "of log(1 + 20 f cos θ). albedo: rms relative error of directional albedos. sphere: mean ΔE_ITP under three "
      "lights, of matter known to {:.2g}; a smooth interface's mirror image is left out of it.\n\n"
      "![error against bytes](error.png)\n",
      truth_error, sphere_truth_error);
  for (const ValidatedStrategy& strategy : strategies) {
    page +=
        "\n## " + strategy.name +
        "\n\n| bytes | closures | last step | simplification | brdf | albedo | sphere | model | brdf | albedo | sphere "
        "|\n|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (const ValidatedStage& stage : strategy.stages) {
      std::string words;
      for (const SimplifyStep& step : stage.stage.steps) {
        if (strategy.name == "error_driven" || &step == &stage.stage.steps.back()) {
          words += (words.empty() ? "" : "; ") + step_text(tree, step);
        }
      }
      const TreeErrors &s = stage.simplification, &m = stage.model;
      page += fmt::format("| {} | {} | {} | {:.4f} | {:.4f} | {:.4f} | {} | {:.4f} | {:.4f} | {:.4f} | {} |\n",
                          stage.stage.bytes, stage.stage.closures, words.empty() ? "the full tree" : words, s.error(),
                          s.brdf_rms_log, s.albedo_rms_relative, sphere_text(s), m.error(), m.brdf_rms_log,
                          m.albedo_rms_relative, sphere_text(m));
    }
  }
  page += fmt::format(
      "\n## Statistics\n\nAll coverage events apart take {} closures. The one virtual slab above each closure differs "
      "from them by {:.4f}; they themselves are {:.4f} from matter.\n",
      exact.closures, exact.difference.error(), exact.model.error());
  if (!notes.empty()) {
    page += "\n## What matter leaves out\n\n";
    for (const std::string& note : notes) page += "- " + note + "\n";
  }
  return page;
}

std::string SlabValidation::figure(const std::string& title) const {
  std::vector<std::string> labels;
  ChartPanel model{.title = "against the layers as matter", .series = {}, .lower = 0.0, .upper = 0.01};
  ChartPanel simplification{.title = "against the full tree", .series = {}, .lower = 0.0, .upper = 0.01};
  for (const ValidatedStrategy& strategy : strategies) {
    labels.push_back(strategy.name);
    ChartSeries by_model, by_tree;
    for (const ValidatedStage& stage : strategy.stages) {
      const auto bytes = static_cast<double>(stage.stage.bytes);
      by_model.points.push_back({bytes, stage.model.error()});
      by_model.line.emplace_back(bytes, stage.model.error());
      by_tree.points.push_back({bytes, stage.simplification.error()});
      by_tree.line.emplace_back(bytes, stage.simplification.error());
      model.upper = std::max(model.upper, 1.1 * stage.model.error());
      simplification.upper = std::max(simplification.upper, 1.1 * stage.simplification.error());
    }
    model.series.push_back(std::move(by_model));
    simplification.series.push_back(std::move(by_tree));
  }
  int largest = 0;
  for (const ValidatedStrategy& strategy : strategies) {
    for (const ValidatedStage& stage : strategy.stages) largest = std::max(largest, stage.stage.bytes);
  }
  return chart_figure({model, simplification}, labels, title, "error of BRDF and directional albedo", "bytes per pixel",
                      {.left = 8.0, .right = largest + 4.0, .tick = largest > 48 ? 8.0 : 4.0});
}

}  // namespace lobefit
