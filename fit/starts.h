// Where fits of materials start from.
//
// A first guess comes from the table in closed form; from it a fit grows lobe by lobe, so that each stage starts where
// the one before ended and never ends worse.
#pragma once

#include "fit/table_problem.h"

namespace lobefit {

/// Diffuse albedo, GGX alpha and reflectance at normal incidence.
struct MaterialGuess {
  Rgb albedo;
  double alpha;
  Rgb f0;
};

/// Albedo: a low quantile of π f away from the mirror direction. Alpha and f0: the distribution of facets is the
/// eigenvector of the back-scattering slice (power iteration of Dupuy et al. 2015, Extracting Microfacet-based BRDF
/// Parameters from Arbitrary Materials with Power Iterations, section 3), alpha its mean slope times 2/π, f0 four times
/// its eigenvalue. `weights` say which entries count.
MaterialGuess guess_material(const Table& table, const std::vector<double>& weights);

/// `values` with what the guess says about the model's parameters: albedo or base_color, alpha or roughness, f0.
ParameterValues with_guess(ParameterValues values, const MaterialGuess& guess);

/// The free parameters in the order in which a fit lets them go: colours of diffuse lobes; roughness and reflectance;
/// the base tier; the other tiers; a second specular lobe. Stages without parameters are left out.
std::vector<std::vector<std::string>> fit_stages(const ParameterValues& values, const std::vector<std::string>& free);

/// Start number `index` of staged fits over the whole plan: the end of the last stage. Start 0 takes the guess as it
/// is, the others move what the guess can't know.
Minimum staged_start(const TableProblem& problem, const ParameterValues& values, const FitOptions& options, int index,
                     Monitor& monitor);

/// Start number `index` > 0 without a guess: a scrambled Sobol pair per two variables, inside the ranges.
std::vector<double> sobol_start(const FitVariables& variables, std::uint64_t seed, int index);

}  // namespace lobefit
