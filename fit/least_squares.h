// Bounded nonlinear least squares by Ceres, with uncertainty.
//
//   minimise ½ Σ r_i(x)²,  lower ≤ x ≤ upper
//
// Residuals come in one call for all of them; the caller may be parallel inside. Ceres itself runs on one thread over
// fixed blocks of residuals, so that the result does not depend on the number of threads. A problem of very many
// residuals hands over its normal equations in their place.
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

/// Σ r², Jᵀr, and JᵀJ (row-major): all that Gauss, Newton, Levenberg and Marquardt ask of residuals.
struct NormalEquations {
  double sum_of_squares = 0.0;
  std::vector<double> gradient, normal;
};
/// The normal equations at x; only the sum of squares unless `derivatives`. Returns false where the model can't be
/// evaluated.
using NormalFunction = std::function<bool(std::span<const double> x, bool derivatives, NormalEquations& result)>;

struct LeastSquaresProblem {
  ResidualFunction evaluate;  // keeps the digits of ill-conditioned problems
  NormalFunction condense;    // if set, takes the place of `evaluate`: no Jacobian is stored
  std::size_t residual_count = 0;
  std::vector<std::string> names;  // of the variables
  std::vector<double> start, lower, upper;
  std::vector<char> fixed;  // of each variable: 1 where minimise() leaves it at its start; empty: none
  /// The covariance of Jᵀr under the data's own error, row-major; empty if the data are exact. Called once, at the
  /// solution.
  std::function<std::vector<double>(std::span<const double> x)> gradient_covariance;
  /// For the curvature that JᵀJ leaves out, Σ r ∇²r: a smaller problem that stands for this one; empty: itself.
  NormalFunction curvature_sample;
  /// Degrees of freedom behind gradient_covariance; 0 means many (normal quantiles).
  int degrees_of_freedom = 0;
  int maximum_iterations = 200;
  /// Converged when a step gains less than this share of the sum of squares.
  double tolerance = 1e-15;
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
  std::vector<std::vector<double>> correlation;     // from JᵀJ; 0 for variables at a bound or without effect
  std::vector<std::vector<double>> covariance;      // of the data's own error; empty if they are exact
  std::vector<std::vector<double>> inverse_normal;  // (JᵀJ)⁻¹
  double residual_variance = 0.0;                   // RSS/(n-p)
  double quantile = 0.0;                            // of the 95 % intervals, in standard errors
  double sum_of_squares = 0.0;
  bool converged = false;
  bool identifiable = true;
  int iterations = 0;
  std::string termination;           // Ceres' own words
  std::vector<double> history;       // √Σr² at the start and after each iteration
  std::vector<std::string> remarks;  // what a person should know: bounds, directions that the data don't decide
};

/// The minimum, with its errors. Throws Interrupted if the monitor asks.
LeastSquaresSolution solve(const LeastSquaresProblem& problem, Monitor& monitor);

struct Minimum {
  std::vector<double> x;
  double sum_of_squares = 0.0;
  bool converged = false;
  int iterations = 0;
  std::string termination;
  std::vector<double> history;  // √Σr² at the start and after each iteration
};
/// The minimum alone.
Minimum minimise(const LeastSquaresProblem& problem, Monitor& monitor);
/// Errors, intervals, correlation and identifiability at a minimum.
LeastSquaresSolution analyse(const LeastSquaresProblem& problem, const Minimum& minimum);

}  // namespace lobefit
