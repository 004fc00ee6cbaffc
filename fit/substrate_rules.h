// The constants of FittedBlend, fitted to pairs of slabs, and how well rules do on pairs that no fit has seen.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "fit/least_squares.h"
#include "fit/substrate_pairs.h"
#include "models/substrate/blend.h"
#include "reference/json_reader.h"

namespace lobefit {

using RuleConstants = FittedBlend::Constants<double>;

/// Layers with their truth, and mixes.
struct RulePairs {
  std::vector<LayeredPair> layers;
  Table brdf, albedo;  // of `layers`: over pair_grid() and pair_views(), a parameter row per pair
  std::vector<MixedPair> mixes;

  /// Pairs first … first + count - 1 of a seed, without tables.
  static RulePairs draw(std::uint64_t seed, std::uint32_t first, std::uint32_t count);
};

struct RuleFitOptions {
  int diffuse_model = 0;  // of slab_diffuse_choices
  /// Share of BRDFs in the objective, the rest being directional albedos.
  double brdf_weight = 0.2;
};

/// Least squares over all pairs. Residuals: relative errors of directional albedos, and differences of log(1 + 20 f cos
/// θ_i), each bent by a pseudo-Huber function beyond .1, so that no few pairs decide; of pairs under a smooth
/// interface, BRDFs over diffuse bottoms only and away from the mirror direction, where the truth has a delta function.
/// Rules with one lobe and with two count alike. Intervals treat pairs as independent, their own residuals not.
LeastSquaresSolution fit_rules(const RulePairs& pairs, const RuleFitOptions& options, Monitor& monitor);
RuleConstants constants_of(const LeastSquaresSolution& solution);

/// Relative errors of directional albedos, all views and channels.
struct ErrorQuantiles {
  std::size_t count = 0;
  double median = 0.0, p90 = 0.0, largest = 0.0;
  static ErrorQuantiles of(std::vector<double> errors);
};

/// One way to show layers, judged over one kind of pairs.
struct RuleScore {
  std::string bottom, medium, interface;  // "diffuse" | "conductor"; pair_medium_names or "all"; "smooth" | "rough" | …
  ErrorQuantiles baseline, tree, fitted, fitted_haze;
};
/// Every kind of bottom × {all, clear, absorbing, scattering} × {all, smooth, rough}. "clear+absorbing" stands for what
/// the baseline was made for: coats that don't scatter.
std::vector<RuleScore> score_rules(const RulePairs& pairs, const RuleConstants& constants,
                                   const RuleFitOptions& options);
/// Mixes: rms of log(1 + 20 f cos θ_i) against the mix of both, baseline and fitted.
struct MixScore {
  ErrorQuantiles baseline, fitted, fitted_haze;  // of the rms of each mix
};
MixScore score_mixes(const RulePairs& pairs, const RuleConstants& constants, const RuleFitOptions& options);

// ---- rule files ----------------------------------------------------------------------------------------------------

/// {"constants": {name: {"value", "stderr", "ci95", "at_bound"}}, "provenance": {…}}.
Json rules_json(const LeastSquaresSolution& solution);
/// Constants of a rule file. Throws Error(invalid_input).
RuleConstants read_rules(const std::filesystem::path& path);

}  // namespace lobefit
