#include "reference/height_field/study.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "models/error.h"
#include "models/geometry.h"
#include "reference/diffuse/facet_quadrature.h"
#include "reference/height_field/paths.h"
#include "reference/height_field/smith_walk.h"

namespace lobefit {

namespace {

constexpr std::size_t kept_orders = 3;      // 1, 2, and all further ones
constexpr std::uint32_t block_paths = 256;  // followed by one task

struct Angles {
  double theta, phi;
};

/// Lights of a view: a slice through the plane of incidence, and the table's.
std::vector<Angles> lights_of(double theta_o, const std::vector<double>& theta) {
  std::vector<Angles> lights;
  const auto add = [&](double theta_i, double phi) {
    // At the normal there is but one azimuth.
    if (theta_i == 0.0 || theta_o == 0.0) phi = 0.0;
    const auto same = [&](const Angles& a) { return a.theta == theta_i && a.phi == phi; };
    if (std::none_of(lights.begin(), lights.end(), same)) lights.push_back({theta_i, phi});
  };
  for (const double phi : {0.0, 90.0, 180.0}) {
    for (const double theta_i : theta) add(theta_i, phi);
  }
  for (const double phi : {0.0, 180.0}) {
    for (int theta_i = 0; theta_i <= 85; theta_i += 5) add(theta_i, phi);
  }
  return lights;
}

struct View {
  double theta_o;
  Direction wo;
  std::vector<Angles> angles;
  std::vector<Direction> wi;
};

void check_options(const HeightFieldOptions& options) {
  if (options.surfaces < 2) {
    throw Error(ExitCode::usage, "one surface tells nothing of the spread between surfaces", "height field",
                "choose 2 surfaces or more");
  }
  if (options.theta.empty()) throw Error(ExitCode::usage, "no angles", "height field", "choose some");
  for (auto theta = options.theta.begin(); theta != options.theta.end(); ++theta) {
    if (std::find(options.theta.begin(), theta, *theta) != theta) {
      throw Error(ExitCode::usage, fmt::format("theta = {:g} is given twice", *theta), "height field", "give it once");
    }
    if (!(*theta >= 0.0 && *theta < 90.0)) {
      throw Error(ExitCode::usage, fmt::format("theta = {:g} is out of range", *theta), "height field",
                  "choose angles from 0 to below 90 degrees");
    }
  }
}

/// Sums of `add(view, points of the replicate, first path, paths, sums)` over blocks, in their order, by many threads.
template <class Add>
std::vector<ScatteringOrders> follow(const std::vector<View>& views, const HeightFieldOptions& options,
                                     std::uint32_t replicate, std::uint32_t paths, Monitor& monitor, const Add& add) {
  const std::uint32_t blocks = (paths + block_paths - 1) / block_paths;
  std::vector<ScatteringOrders> parts;
  for (const View& view : views) parts.resize(parts.size() + blocks, ScatteringOrders(kept_orders, view.wi.size()));
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t part) {
    monitor.check();
    const std::size_t v = part / blocks;
    const auto first = static_cast<std::uint32_t>(part % blocks) * block_paths;
    const SamplePoints points(Sampler::sobol, {options.seed, v + 1, replicate});
    add(views[v], points, first, std::min(block_paths, paths - first), parts[part]);
    monitor.advance(1);
  });
  std::vector<ScatteringOrders> sums;
  for (std::size_t v = 0; v < views.size(); ++v) {
    sums.emplace_back(kept_orders, views[v].wi.size());
    for (std::uint32_t b = 0; b < blocks; ++b) sums[v].add(parts[v * blocks + b]);
    sums[v].divide_by(paths);
  }
  return sums;
}

/// Mean and error of a number that each replicate has.
template <class Replicates, class Value>
MeanAndError over(const Replicates& replicates, const Value& value) {
  std::vector<double> values;
  for (const auto& replicate : replicates) values.push_back(value(replicate));
  return mean_and_error<double>(values);
}

}  // namespace

std::vector<HeightFieldPair> HeightFieldStudy::slice(double theta_o) const {
  std::vector<HeightFieldPair> result;
  for (const HeightFieldPair& pair : pairs) {
    if (pair.theta_o != theta_o || pair.phi == 90.0) continue;
    result.push_back(pair);
    // Both sides of a view along the normal are the same.
    if (theta_o == 0.0 && pair.theta_i > 0.0) {
      result.push_back(pair);
      result.back().phi = 180.0;
    }
  }
  std::ranges::sort(result, {}, [](const HeightFieldPair& p) { return p.phi == 180.0 ? -p.theta_i : p.theta_i; });
  return result;
}

std::vector<HeightFieldPair> HeightFieldStudy::table() const {
  std::vector<HeightFieldPair> result;
  for (const HeightFieldPair& pair : pairs) {
    if (std::ranges::find(options.theta, pair.theta_i) != options.theta.end()) result.push_back(pair);
  }
  return result;
}

HeightFieldStudy study_height_field(const HeightFieldOptions& options, Monitor& monitor) {
  check_options(options);
  std::vector<View> views;
  for (const double theta_o : options.theta) {
    View view{theta_o, direction(radians(theta_o), 0.0), lights_of(theta_o, options.theta), {}};
    for (const Angles& light : view.angles) view.wi.push_back(direction(radians(light.theta), radians(light.phi)));
    views.push_back(std::move(view));
  }
  const auto surfaces = static_cast<std::uint32_t>(options.surfaces);
  const std::uint32_t blocks = (options.samples + block_paths - 1) / block_paths;

  // [surface][view]
  std::vector<std::vector<ScatteringOrders>> explicit_orders, smith_orders;
  std::vector<SlopeStatistics> slopes;
  std::vector<std::vector<double>> facing_areas;
  HeightFieldStudy study{.options = options};
  monitor.begin("explicit surfaces", std::uint64_t{surfaces} * views.size() * blocks);
  for (std::uint32_t s = 0; s < surfaces; ++s) {
    monitor.check();
    const HeightField surface =
        HeightField::gaussian(options.cells, options.correlation_length, options.alpha, {options.seed, 0, s});
    slopes.push_back(surface.slope_statistics());
    facing_areas.emplace_back();
    for (const View& view : views) facing_areas.back().push_back(surface.facing_area(view.wo));
    const HeightFieldTracer tracer(surface);
    explicit_orders.push_back(
        follow(views, options, s, options.samples, monitor,
               [&](const View& view, const SamplePoints& points, std::uint32_t first, std::uint32_t count,
                   ScatteringOrders& sums) { add_paths(tracer, view.wo, view.wi, points, first, count, sums); }));
    for (const ScatteringOrders& sums : explicit_orders.back()) study.lost += sums.lost;
  }
  study.paths = std::uint64_t{surfaces} * views.size() * options.samples;
  monitor.end();

  // As many walks as paths, and at least so many that their error hides nothing.
  const auto walks = static_cast<std::uint32_t>(
      std::max<std::uint64_t>(4096, std::uint64_t{surfaces} * options.samples / replicate_count));
  monitor.begin("Smith's walks",
                std::uint64_t{replicate_count} * views.size() * ((walks + block_paths - 1) / block_paths));
  for (std::uint32_t r = 0; r < replicate_count; ++r) {
    smith_orders.push_back(follow(views, options, surfaces + r, walks, monitor,
                                  [&](const View& view, const SamplePoints& points, std::uint32_t first,
                                      std::uint32_t count, ScatteringOrders& sums) {
                                    add_smith_walks(Distribution::beckmann, options.alpha, view.wo, view.wi, points,
                                                    first, count, sums);
                                  }));
  }
  monitor.end();

  const double rms = options.alpha / std::sqrt(2.0);
  study.slopes = {over(slopes, [&](const SlopeStatistics& s) { return s.rms_x / rms; }),
                  over(slopes, [&](const SlopeStatistics& s) { return s.rms_y / rms; }),
                  over(slopes, [](const SlopeStatistics& s) { return s.kurtosis_x; }),
                  over(slopes, [](const SlopeStatistics& s) { return s.kurtosis_y; }),
                  over(slopes, [](const SlopeStatistics& s) { return s.correlation; })};
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto compare = [&](const auto& value) {
      const auto of_view = [&](const std::vector<ScatteringOrders>& replicate) { return value(replicate[v]); };
      return Comparison{over(explicit_orders, of_view), over(smith_orders, of_view)};
    };
    const View& view = views[v];
    const double lambda_o = smith_lambda(Distribution::beckmann, options.alpha, view.wo);
    study.views.push_back({view.theta_o,
                           {over(facing_areas, [&](const std::vector<double>& areas) { return areas[v]; }),
                            {view.wo.z * (1.0 + lambda_o), 0.0}},
                           compare([](const ScatteringOrders& sums) { return sums.albedo[0]; }),
                           compare([](const ScatteringOrders& sums) { return sums.albedo[1]; }),
                           compare([](const ScatteringOrders& sums) { return sums.albedo[2]; })});
    for (std::size_t j = 0; j < view.wi.size(); ++j) {
      const std::size_t lights = view.wi.size();
      HeightFieldPair pair{.theta_o = view.theta_o, .theta_i = view.angles[j].theta, .phi = view.angles[j].phi};
      pair.first = compare([&](const ScatteringOrders& sums) { return sums.brdf[j]; });
      pair.second = compare([&](const ScatteringOrders& sums) { return sums.brdf[lights + j]; });
      pair.all = compare([&](const ScatteringOrders& sums) {
        return sums.brdf[j] + sums.brdf[lights + j] + sums.brdf[2 * lights + j];
      });
      // One bounce has a quadrature: f = G2 K/(π μi μo).
      const double lambda_i = smith_lambda(Distribution::beckmann, options.alpha, view.wi[j]);
      pair.unmasked = shared_visibility(Distribution::beckmann, options.alpha, view.wi[j], view.wo) /
                      (pi * view.wi[j].z * view.wo.z);
      pair.separable = pair.unmasked / ((1.0 + lambda_i) * (1.0 + lambda_o));
      pair.first.smith = {pair.unmasked / (1.0 + lambda_i + lambda_o), 0.0};
      study.pairs.push_back(pair);
    }
  }
  return study;
}

double HeightFieldStudy::t_quantile(double probability) const {
  return boost::math::quantile(boost::math::students_t(degrees_of_freedom()), 1.0 - 0.5 * probability);
}

std::string HeightFieldStudy::conclusion() const {
  constexpr double chance = 1e-4;
  const double significant = t_quantile(chance);
  const auto percent = [](const Comparison& c) {
    return fmt::format("{:+.1f} ± {:.1f} %", 100.0 * c.difference(), 100.0 * c.difference_error());
  };
  const auto side = [](const HeightFieldPair& pair) {
    if (pair.theta_i == 0.0 || pair.theta_o == 0.0) return std::string();
    return std::string(pair.phi == 0.0 ? " on the retro side" : pair.phi == 180.0 ? " on the mirror side" : " across");
  };
  const auto place = [&](const HeightFieldPair& pair) {
    return fmt::format("θo = {:g}°, θi = {:g}°{}", pair.theta_o, pair.theta_i, side(pair));
  };

  double near_normal = -1.0;
  const HeightFieldPair *worst = nullptr, *worst_second = nullptr;
  const std::vector<HeightFieldPair> listed = table();
  for (const HeightFieldPair& pair : listed) {
    if (max(pair.theta_i, pair.theta_o) <= 30.0) near_normal = max(near_normal, abs(pair.first.difference()));
    const auto is_worse = [&](const Comparison& a, const Comparison& b) {
      return abs(a.difference()) > abs(b.difference());
    };
    if (abs(pair.first.deviations()) > significant && (!worst || is_worse(pair.first, worst->first))) worst = &pair;
    if (abs(pair.second.deviations()) > significant && (!worst_second || is_worse(pair.second, worst_second->second))) {
      worst_second = &pair;
    }
  }
  std::string text = "Smith's theory, height-correlated, at alpha " + fmt::format("{:g}", options.alpha) + ": ";
  if (near_normal >= 0.0) {
    text += fmt::format("its single bounce holds within {:.2g} % where light and view lie within 30° of the normal. ",
                        100.0 * near_normal);
  }
  if (worst == nullptr) {
    return text + fmt::format("No pair's single bounce differs by more than {:.1f} standard errors (chance {:g} each).",
                              significant, chance);
  }
  text += fmt::format("It fails most at {}: the surface differs by {} ({:.0f} standard errors, {} degrees of freedom)",
                      place(*worst), percent(worst->first), abs(worst->first.deviations()), degrees_of_freedom());
  // Toward the light the view sees what is lit: Smith takes the two visibilities as no more alike there than elsewhere.
  if (worst->phi == 0.0 && worst->theta_i == worst->theta_o && worst->first.difference() > 0.0) {
    text += ", because what the view sees is never shadowed from its own direction";
  }
  text += ".";
  for (const HeightFieldPair& pair : listed) {
    if (pair.phi == 180.0 && pair.theta_i == worst->theta_i && pair.theta_o == worst->theta_o && &pair != worst) {
      text += " On the mirror side there: " + percent(pair.first) + ".";
    }
  }
  if (worst_second != nullptr) {
    text += fmt::format(" Second bounce: off by {} at {}", percent(worst_second->second), place(*worst_second));
  }
  const auto steepest = std::ranges::max_element(views, {}, [](const HeightFieldView& v) { return v.theta_o; });
  if (abs(steepest->second.deviations()) > significant) {
    text +=
        fmt::format("{} its directional albedo at θo = {:g}° by {}",
                    worst_second != nullptr ? ";" : " Second bounce:", steepest->theta_o, percent(steepest->second));
    text += ".";
  } else if (worst_second != nullptr) {
    text += ".";
  }
  return text;
}

}  // namespace lobefit
