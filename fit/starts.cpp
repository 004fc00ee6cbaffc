#include "fit/starts.h"

#include <algorithm>
#include <cmath>

#include "reference/sample_points.h"

namespace lobefit {

namespace {

double polar(const Direction& w) { return std::atan2(std::hypot(w.x, w.y), w.z); }

/// The smallest value that `share` of the weight does not exceed.
double weighted_quantile(std::vector<std::pair<double, double>> value_weight, double share) {
  std::ranges::sort(value_weight);
  double total = 0.0, below = 0.0;
  for (const auto& [value, weight] : value_weight) total += weight;
  for (const auto& [value, weight] : value_weight) {
    below += weight;
    if (below >= share * total) return value;
  }
  return value_weight.empty() ? 0.0 : value_weight.back().first;
}

/// π f of a channel where the mirror direction is far.
double diffuse_level(const Table& table, const std::vector<double>& weights, int channel) {
  std::vector<std::pair<double, double>> off_specular, all;
  for (std::size_t entry = 0; entry < weights.size(); ++entry) {
    if (weights[entry] == 0.0) continue;
    const Direction wi = table.wi(entry), wo = table.wo(entry);
    const double value = pi * std::max(0.0f, table.value(entry, channel));
    all.emplace_back(value, weights[entry]);
    const Direction sum = wi + wo;
    if (polar(sum) > radians(30.0) && polar(wi) < radians(65.0) && polar(wo) < radians(65.0))
      off_specular.emplace_back(value, weights[entry]);
  }
  constexpr double low = 0.3;
  return weighted_quantile(off_specular.empty() ? std::move(all) : std::move(off_specular), low);
}

/// The mean over channels of the back-scattering slice above `diffuse`, at `theta` (radians); empty where the table has
/// none.
std::vector<double> back_scattering(const Table& table, std::span<const double> theta, const Rgb& diffuse) {
  const double phi = table.coordinates == Coordinates::spherical ? radians(table.grid.phi.values.front()) : 0.0;
  std::vector<double> slice;
  try {
    for (const double t : theta) {
      const Rgb f = table.interpolate(0, direction(t, phi), direction(t, 0.0));
      const double mean = table.channels == 1 ? f.x - diffuse.x / pi
                                              : (f.x + f.y + f.z - (diffuse.x + diffuse.y + diffuse.z) / pi) / 3.0;
      slice.push_back(std::max(0.0, mean));
    }
  } catch (const Error&) {
    return {};
  }
  return slice;
}

struct Lobe {
  double alpha, f0;
};

/// Facet distribution by power iteration over the slice; alpha by its mean slope, π α/2 for GGX.
std::optional<Lobe> power_iteration(std::span<const double> theta, std::span<const double> slice) {
  const std::size_t n = slice.size();
  if (n < 4) return std::nullopt;
  const double step = theta[1] - theta[0];
  constexpr int azimuths = 32;
  std::vector<double> kernel(n * n, 0.0);
  for (std::size_t o = 0; o < n; ++o) {
    for (std::size_t m = 0; m < n; ++m) {
      double sum = 0.0;
      for (int k = 0; k < azimuths; ++k) {
        const double cos_phi = std::cos((k + 0.5) * 2.0 * pi / azimuths);
        sum +=
            std::max(0.0, std::sin(theta[o]) * std::sin(theta[m]) * cos_phi + std::cos(theta[o]) * std::cos(theta[m]));
      }
      kernel[o * n + m] = slice[o] * std::cos(theta[o]) * sum * (2.0 * pi / azimuths) * std::sin(theta[m]) * step;
    }
  }
  std::vector<double> distribution(n, 1.0), next(n);
  double eigenvalue = 0.0;
  for (int iteration = 0; iteration < 8; ++iteration) {
    double projected = 0.0, before = 0.0;
    for (std::size_t o = 0; o < n; ++o) {
      next[o] = 0.0;
      for (std::size_t m = 0; m < n; ++m) next[o] += kernel[o * n + m] * distribution[m];
      projected += next[o] * std::sin(theta[o]) * std::cos(theta[o]);
      before += distribution[o] * std::sin(theta[o]) * std::cos(theta[o]);
    }
    if (!(projected > 0.0)) return std::nullopt;
    eigenvalue = projected / before;
    distribution = next;
    for (double& d : distribution) d /= eigenvalue;
  }
  double slopes = 0.0, facets = 0.0;
  for (std::size_t m = 0; m < n; ++m) {
    slopes += distribution[m] * std::sin(theta[m]) * std::sin(theta[m]);  // tan θ cos θ = sin θ
    facets += distribution[m] * std::sin(theta[m]) * std::cos(theta[m]);
  }
  return Lobe{2.0 / pi * slopes / facets, 4.0 * eigenvalue};
}

bool has(const ParameterValues& values, std::string_view name) {
  return std::ranges::find(values.list(), name, &ParameterInfo::name) != values.list().end();
}

void set_within(ParameterValues& values, std::string_view name, const Rgb& rgb) {
  const ParameterInfo& info = values.info(name);
  std::vector<double> components;
  for (const double c : {rgb.x, rgb.y, rgb.z}) components.push_back(std::clamp(c, info.lower, info.upper));
  components.resize(static_cast<std::size_t>(info.components));
  values.set(name, components);
}
void set_within(ParameterValues& values, std::string_view name, double value) {
  const ParameterInfo& info = values.info(name);
  values.set(name,
             std::vector<double>(static_cast<std::size_t>(info.components), std::clamp(value, info.lower, info.upper)));
}

constexpr std::array diffuse_colors{"albedo", "diffuse_albedo", "base_color", "color"};
constexpr std::array lobe_shapes{"alpha", "alpha_x", "alpha_y", "roughness", "f0", "specular", "metallic"};
constexpr std::string_view second_lobe_scale = "dual_specular_roughness_scale",
                           second_lobe_opacity = "dual_specular_opacity";

enum Stage { diffuse_stage, shape_stage, base_stage, tier_stage, second_lobe_stage, stage_count };

Stage stage_of(const ParameterInfo& info) {
  if (std::ranges::find(diffuse_colors, info.name) != diffuse_colors.end()) return diffuse_stage;
  if (std::ranges::find(lobe_shapes, info.name) != lobe_shapes.end()) return shape_stage;
  if (info.name == second_lobe_scale || info.name == second_lobe_opacity) return second_lobe_stage;
  return info.tier == Tier::base ? base_stage : tier_stage;
}

/// A product belongs where its intensity does.
std::string_view stage_name(const std::string& parameter, const FitVariables& variables) {
  if (variables.tint.empty()) return parameter;
  const auto product = std::ranges::find(known_products, parameter, &Product::tint);
  return product != known_products.end() ? product->intensity : std::string_view(parameter);
}

}  // namespace

MaterialGuess guess_material(const Table& table, const std::vector<double>& weights) {
  MaterialGuess guess{.albedo = {}, .alpha = 0.3, .f0 = {0.04, 0.04, 0.04}};
  double* const albedo[3] = {&guess.albedo.x, &guess.albedo.y, &guess.albedo.z};
  for (int c = 0; c < 3; ++c) *albedo[c] = diffuse_level(table, weights, std::min(c, table.channels - 1));
  constexpr int steps = 80;
  std::vector<double> theta;
  for (int k = 0; k < steps; ++k) theta.push_back(radians(80.0 * (k + 0.5) / steps));
  if (table.coordinates == Coordinates::spherical) {
    const double last = radians(std::min(table.grid.theta_i.values.back(), table.grid.theta_o.values.back()));
    const double first = radians(std::max(table.grid.theta_i.values.front(), table.grid.theta_o.values.front()));
    std::erase_if(theta, [&](double t) { return t < first || t > last; });
  }
  if (const auto lobe = power_iteration(theta, back_scattering(table, theta, guess.albedo))) {
    guess.alpha = std::clamp(lobe->alpha, 0.01, 1.0);
    guess.f0 = Rgb{1.0, 1.0, 1.0} * std::clamp(lobe->f0, 0.005, 0.95);
  }
  return guess;
}

ParameterValues with_guess(ParameterValues values, const MaterialGuess& guess) {
  for (const char* name : {"albedo", "base_color"}) {
    if (has(values, name)) set_within(values, name, guess.albedo);
  }
  if (has(values, "alpha")) set_within(values, "alpha", guess.alpha);
  if (has(values, "roughness")) set_within(values, "roughness", std::sqrt(guess.alpha));
  if (has(values, "f0")) set_within(values, "f0", guess.f0);
  return values;
}

std::vector<std::vector<std::string>> fit_stages(const ParameterValues& values, const std::vector<std::string>& free) {
  std::vector<std::vector<std::string>> stages(stage_count);
  for (const std::string& name : free) stages[stage_of(values.info(name))].push_back(name);
  std::erase_if(stages, [](const auto& stage) { return stage.empty(); });
  return stages;
}

std::vector<double> sobol_start(const FitVariables& variables, std::uint64_t seed, int index) {
  std::vector<double> start(variables.start.size());
  for (std::size_t i = 0; i < start.size(); ++i) {
    const SamplePoints points(Sampler::sobol, {seed, i / 2, own_stream});
    const double u = points(static_cast<std::uint32_t>(index))[i % 2];
    start[i] = variables.lower[i] + u * (variables.upper[i] - variables.lower[i]);
  }
  return start;
}

Minimum staged_start(const TableProblem& problem, const ParameterValues& values, const FitOptions& options, int index,
                     Monitor& monitor) {
  const FitVariables& variables = problem.variables();
  const std::size_t count = variables.names.size();
  const auto draw = [&](std::size_t dimension) {
    const SamplePoints points(Sampler::sobol, {options.seed, dimension / 2, own_stream});
    return points(static_cast<std::uint32_t>(index))[dimension % 2];
  };

  // Where each variable starts, and the stage that lets it go.
  std::vector<double> x = problem.variables_of(values);
  std::vector<double> second_lobe = x;  // where the second lobe starts, absent before
  std::vector<int> stage(count);
  double narrower = 0.7;
  for (std::size_t v = 0; v < count; ++v) {
    const ParameterInfo& info = values.info(stage_name(variables.parameters[v], variables));
    stage[v] = stage_of(info);
    const double u = draw(v);
    if (info.name == second_lobe_scale) {
      second_lobe[v] = index == 0 ? 2.5 : 1.3 + 2.7 * u;
    } else if (info.name == second_lobe_opacity) {
      second_lobe[v] = index == 0 ? 0.3 : 0.1 + 0.6 * u;
      x[v] = 0.0;
    } else if (index > 0 && (info.name == "alpha" || info.name == "roughness")) {
      x[v] *= std::pow(info.name == "alpha" ? 3.0 : std::sqrt(3.0), 2.0 * u - 1.0);
      narrower = 0.4 + 0.6 * draw(count);
    } else if (index > 0 && stage[v] >= base_stage) {
      // Ranges as wide as an intensity's are no help: between a quarter and four times the start.
      const double range = variables.upper[v] - variables.lower[v];
      x[v] = range > 16.0 ? x[v] * std::pow(4.0, 2.0 * u - 1.0) : variables.lower[v] + (0.15 + 0.75 * u) * range;
      if (variables.lower[v] < 0.0) x[v] = 0.0;
    }
    x[v] = std::clamp(x[v], variables.lower[v], variables.upper[v]);
  }

  // Every other start looks for the second lobe before the other tiers.
  std::vector<Stage> order{diffuse_stage, shape_stage, base_stage, tier_stage, second_lobe_stage};
  if (index % 2 == 1) order = {diffuse_stage, shape_stage, second_lobe_stage, base_stage, tier_stage};
  Minimum best{.x = x, .sum_of_squares = std::numeric_limits<double>::infinity()};
  std::vector<char> let_go(stage_count, 0);
  LeastSquaresProblem least_squares;
  std::vector<double> lower = variables.lower, upper = variables.upper;
  const auto run = [&](std::vector<double> start) {
    // The prior is a share of the misfit, of which the stage before knows.
    const double misfit = std::isfinite(best.sum_of_squares) ? std::sqrt(best.sum_of_squares) : 0.02;
    least_squares = problem.with_prior(std::move(start), options.prior * misfit);
    least_squares.lower = lower;
    least_squares.upper = upper;
    least_squares.fixed.assign(count, 0);
    for (std::size_t v = 0; v < count; ++v) least_squares.fixed[v] = let_go[static_cast<std::size_t>(stage[v])] == 0;
    least_squares.maximum_iterations = 12;
    least_squares.tolerance = 1e-3;
    return minimise(least_squares, monitor);
  };
  for (const Stage next : order) {
    if (std::ranges::find(stage, next) == stage.end()) continue;
    let_go[next] = 1;
    std::vector<double> start = best.x;
    if (next == second_lobe_stage) {
      for (std::size_t v = 0; v < count; ++v) {
        if (stage[v] == second_lobe_stage) start[v] = second_lobe[v];
        if (variables.parameters[v] == "alpha") start[v] = std::max(variables.lower[v], narrower * start[v]);
      }
    }
    Minimum found = run(std::move(start));
    // A second lobe may end worse than none.
    if (next == second_lobe_stage && !(found.sum_of_squares <= best.sum_of_squares)) continue;
    best = std::move(found);
    if (next != base_stage) continue;
    // A tint can't turn its intensity's sign.
    for (std::size_t k = 0; k < variables.tint.size(); ++k) {
      const auto first = static_cast<std::size_t>(variables.variable_of_slot[variables.tint[k]]);
      if (variables.lower[first] >= 0.0) continue;
      const double sum = best.x[first] + best.x[first + 1] + best.x[first + 2];
      for (std::size_t v = first; v < first + 3; ++v) {
        (sum < 0.0 ? upper : lower)[v] = 0.0;
        best.x[v] = std::clamp(best.x[v], lower[v], upper[v]);
      }
    }
  }
  return best;
}

}  // namespace lobefit
