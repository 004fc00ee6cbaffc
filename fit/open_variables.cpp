#include "fit/open_variables.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>

namespace lobefit {

namespace {

/// Whether each variable moves the model at x.
std::vector<char> effects_at(const LeastSquaresProblem& problem, std::span<const double> x) {
  NormalEquations equations;
  std::vector<char> effects(x.size(), 1);
  if (!problem.condense(x, true, equations)) return effects;  // where the model has no value, nothing is known
  double largest = 0.0;
  for (std::size_t v = 0; v < x.size(); ++v) largest = std::max(largest, equations.normal[v * x.size() + v]);
  for (std::size_t v = 0; v < x.size(); ++v) effects[v] = equations.normal[v * x.size() + v] > 1e-20 * largest;
  return effects;
}

/// The variables that belong to one parameter: [first, end).
std::size_t end_of_parameter(const FitVariables& variables, std::size_t first) {
  std::size_t end = first + 1;
  while (end < variables.parameters.size() && variables.parameters[end] == variables.parameters[first]) ++end;
  return end;
}

/// (x - neutral)ᵀ covariance⁻¹ (x - neutral): Wald's statistic.
double distance_from_neutral(const std::vector<std::size_t>& some, const FitVariables& variables,
                             std::span<const double> x, const LeastSquaresSolution& solution) {
  const auto n = static_cast<Eigen::Index>(some.size());
  Eigen::VectorXd difference(n);
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const std::size_t v = some[static_cast<std::size_t>(k)];
    difference[k] = x[v] - variables.neutral[v];
    for (Eigen::Index l = 0; l < n; ++l) covariance(k, l) = solution.covariance[v][some[static_cast<std::size_t>(l)]];
  }
  return difference.dot(covariance.ldlt().solve(difference));
}

/// What Wald's statistic has to exceed before `count` numbers are more than noise.
double least_distance(std::size_t count, int degrees_of_freedom) {
  constexpr double false_alarm = 1e-6;
  const auto n = static_cast<double>(count);
  if (degrees_of_freedom == 0) return quantile(complement(boost::math::chi_squared(n), false_alarm));
  return n * quantile(complement(boost::math::fisher_f(n, degrees_of_freedom), false_alarm));
}

}  // namespace

void mark_open_variables(const TableProblem& problem, std::span<const double> x, LeastSquaresSolution& solution) {
  if (solution.covariance.empty()) return;
  const FitVariables& variables = problem.variables();
  const LeastSquaresProblem squares = problem.with_prior(variables.start, 0.0);
  const auto has_interval = [&](std::size_t v) {
    const FittedVariable& variable = solution.variables[v];
    return variable.identifiable && !variable.at_bound && variable.standard_error > 0.0;
  };
  std::vector<char> open(x.size(), 0);
  const auto mark = [&](std::size_t v, std::string remark) {
    if (open[v] == 0) solution.remarks.push_back(std::move(remark));
    open[v] = 1;
  };

  for (std::size_t v = 0; v < x.size(); ++v) {
    if (!has_interval(v)) continue;
    const FittedVariable& variable = solution.variables[v];
    if (variable.ci_high - variable.ci_low > variables.range(v))
      mark(v, fmt::format("{} may be anything in its range", variables.names[v]));
    for (const double end : {variable.ci_low, variable.ci_high}) {
      std::vector<double> there(x.begin(), x.end());
      there[v] = std::clamp(end, variables.lower[v], variables.upper[v]);
      if (!effects_at(squares, there)[v]) {
        mark(v, fmt::format("{} may be anything {} {:.4g}, where it has no effect", variables.names[v],
                            end < x[v] ? "below" : "above", there[v]));
      }
    }
  }

  for (std::size_t first = 0, end = 0; first < x.size(); first = end) {
    end = end_of_parameter(variables, first);
    std::vector<std::size_t> own, hidden;
    std::vector<double> neutral(x.begin(), x.end());
    for (std::size_t v = first; v < end; ++v) {
      neutral[v] = std::clamp(variables.neutral[v], variables.lower[v], variables.upper[v]);
      if (has_interval(v)) own.push_back(v);
    }
    if (own.empty()) continue;
    const std::vector<char> effects = effects_at(squares, neutral);
    for (std::size_t v = 0; v < x.size(); ++v) {
      if (effects[v] == 0 && (v < first || v >= end) && has_interval(v)) hidden.push_back(v);
    }
    if (hidden.empty() || distance_from_neutral(own, variables, x, solution) >
                              least_distance(own.size() + hidden.size(), squares.degrees_of_freedom))
      continue;
    std::vector<std::string> names;
    for (const std::size_t v : hidden) names.push_back(variables.names[v]);
    solution.remarks.push_back(fmt::format(
        "{} can't be told from {:g}, where {} no effect", variables.parameters[first], variables.neutral[first],
        fmt::format("{} {}", fmt::join(names, ", "), names.size() > 1 ? "have" : "has")));
    for (const auto& list : {own, hidden}) {
      for (const std::size_t v : list) open[v] = 1;
    }
  }
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (open[v] == 0) continue;
    solution.variables[v].identifiable = solution.identifiable = false;
  }
}

}  // namespace lobefit
