// Bounded nonlinear least squares by Ceres, with uncertainty.
//
//   minimise ½ Σ r_i(x)²,  lower ≤ x ≤ upper
//
// Residuals come in one call for all of them; the caller may be parallel inside. Ceres itself runs on one thread over
// fixed blocks of residuals, so that the result does not depend on the number of threads.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "reference/monitor.h"

namespace lobefit {

/// r(x), and its Jacobian (row-major, residuals × variables) unless `jacobian` is null. Returns false where the model
/// can't be evaluated.
using ResidualFunction = std::function<bool(std::span<const double> x, std::span<double> residuals, double* jacobian)>;

struct LeastSquaresProblem {
  ResidualFunction evaluate;
  std::size_t residual_count = 0;
  std::vector<std::string> names;  // of the variables
  std::vector<double> start, lower, upper;
  /// Σ over replicates of g gᵀ /(R(R-1)) with g = Jᵀ(residual of the replicate - residual): the covariance of Jᵀr
  /// under the data's own error; row-major, empty if the data are exact. Called once, at the solution.
  std::function<std::vector<double>(std::span<const double> x, std::span<const double> jacobian)> gradient_covariance;
  /// Degrees of freedom behind gradient_covariance; 0 means many (normal quantiles).
  int degrees_of_freedom = 0;
  int maximum_iterations = 200;
};

struct FittedVariable {
  double value = 0.0;
  double standard_error = 0.0;         // from the data's own error
  double ci_low = 0.0, ci_high = 0.0;  // 95 % interval from it
  double misfit_standard_error = 0.0;  // from the residuals: √(RSS/(n-p) (JᵀJ)⁻¹)
  bool at_bound = false;
  bool identifiable = true;
};

struct LeastSquaresSolution {
  std::vector<FittedVariable> variables;
  std::vector<std::vector<double>> correlation;  // from JᵀJ; 0 for variables at a bound or without effect
  double sum_of_squares = 0.0;
  bool converged = false;
  bool identifiable = true;
  int iterations = 0;
  std::string termination;           // Ceres' own words
  std::vector<std::string> remarks;  // what a person should know: bounds, directions that the data don't decide
};

/// Throws Interrupted if the monitor asks.
LeastSquaresSolution solve(const LeastSquaresProblem& problem, Monitor& monitor);

}  // namespace lobefit
