#include "fit/least_squares.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <exception>
#include <limits>

#include "fit/box_steps.h"

namespace lobefit {

namespace {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr std::size_t residuals_per_block = 1024;

/// The normal equations of residuals and their Jacobian.
NormalEquations normal_equations(std::span<const double> residuals, std::span<const double> jacobian,
                                 std::size_t variables) {
  const auto n = static_cast<Eigen::Index>(residuals.size());
  const auto p = static_cast<Eigen::Index>(variables);
  const Eigen::Map<const RowMatrix> j(jacobian.data(), n, p);
  const Eigen::Map<const Eigen::VectorXd> r(residuals.data(), n);
  NormalEquations result{.sum_of_squares = r.squaredNorm(),
                         .gradient = std::vector<double>(variables),
                         .normal = std::vector<double>(variables * variables)};
  Eigen::Map<Eigen::VectorXd>(result.gradient.data(), p) = j.transpose() * r;
  Eigen::Map<RowMatrix>(result.normal.data(), p, p) = j.transpose() * j;
  return result;
}

NormalEquations normal_equations(const LeastSquaresProblem& problem, std::span<const double> x) {
  if (problem.condense) {
    NormalEquations result;
    problem.condense(x, true, result);
    return result;
  }
  std::vector<double> residuals(problem.residual_count), jacobian(problem.residual_count * x.size());
  problem.evaluate(x, residuals, jacobian.data());
  return normal_equations(residuals, jacobian, x.size());
}

/// Residuals and Jacobian at Ceres' current point, computed once for all blocks.
class Cache : public ceres::EvaluationCallback {
 public:
  Cache(const LeastSquaresProblem& problem, const double* x, Monitor& monitor)
      : problem_(problem),
        x_(x),
        monitor_(monitor),
        residuals(problem.residual_count),
        jacobian(problem.residual_count * problem.names.size()) {}

  /// -1 or 1 where variable i is at its lower or upper bound and the cost would fall beyond it; 0 elsewhere. Needs the
  /// Jacobian at the current point.
  int pressed(std::size_t i) const {
    const int side = x_[i] <= problem_.lower[i] ? -1 : x_[i] >= problem_.upper[i] ? 1 : 0;
    if (side == 0) return 0;
    const std::size_t variables = problem_.names.size();
    double gradient = 0.0;
    for (std::size_t row = 0; row < residuals.size(); ++row) gradient += residuals[row] * jacobian[row * variables + i];
    return side * gradient < 0.0 ? side : 0;
  }

  void PrepareForEvaluation(bool jacobians, bool new_point) override {
    if (new_point) has_residuals_ = has_jacobian_ = false;
    if (has_residuals_ && (has_jacobian_ || !jacobians)) return;
    try {
      monitor_.check();
      valid = problem_.evaluate({x_, problem_.names.size()}, residuals, jacobians ? jacobian.data() : nullptr);
    } catch (...) {
      // Ceres is not written to be thrown through: stop it, and throw again outside. It would log an evaluation that
      // fails, so this one pretends to have met the data.
      failure = std::current_exception();
      std::fill(residuals.begin(), residuals.end(), 0.0);
      std::fill(jacobian.begin(), jacobian.end(), 0.0);
    }
    has_residuals_ = true;
    has_jacobian_ = jacobians;
  }

 private:
  const LeastSquaresProblem& problem_;
  const double* x_;
  Monitor& monitor_;
  bool has_residuals_ = false, has_jacobian_ = false;

 public:
  std::vector<double> residuals, jacobian;
  bool valid = true;
  std::exception_ptr failure;
};

/// Rows [first, first + count) of the cache.
class Block : public ceres::CostFunction {
 public:
  Block(const Cache& cache, std::size_t first, std::size_t count, std::size_t variables)
      : cache_(cache), first_(first), count_(count), variables_(variables) {
    set_num_residuals(static_cast<int>(count));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(variables));
  }

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!cache_.valid) return false;
    std::copy_n(cache_.residuals.data() + first_, count_, residuals);
    if (jacobians && jacobians[0]) {
      std::copy_n(cache_.jacobian.data() + first_ * variables_, count_ * variables_, jacobians[0]);
    }
    return true;
  }

 private:
  const Cache& cache_;
  std::size_t first_, count_, variables_;
};

/// Keeps the history. Stops the solver when the user asks, when an evaluation has failed, or when a variable is pressed
/// against a bound that does not hold it yet.
class Watch : public ceres::IterationCallback {
 public:
  Watch(const Cache& cache, const std::vector<int>& held, std::vector<double>& history)
      : cache_(cache), held_(held), history_(history) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
    if (cache_.failure) return ceres::SOLVER_ABORT;
    // Later passes begin where the one before ended.
    if (iteration.iteration > 0 || history_.empty()) history_.push_back(std::sqrt(2.0 * iteration.cost));
    if (!iteration.step_is_successful) return ceres::SOLVER_CONTINUE;
    for (std::size_t i = 0; i < held_.size(); ++i) {
      if (held_[i] == 0 && cache_.pressed(i) != 0) return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const Cache& cache_;
  const std::vector<int>& held_;
  std::vector<double>& history_;
};

/// Names the direction v of variable space: "0.8 a - 0.6 b".
std::string direction_text(const Eigen::VectorXd& v, const std::vector<std::string>& names) {
  std::string text;
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    if (std::abs(v[i]) < 0.05) continue;
    text += fmt::format("{}{:.2f} {}", text.empty() ? (v[i] < 0 ? "-" : "") : (v[i] < 0 ? " - " : " + "),
                        std::abs(v[i]), names[static_cast<std::size_t>(i)]);
  }
  return text;
}

/// Eigenvalues of a normal matrix with unit diagonal, squared singular values, that count as 0.
constexpr double threshold = 1e-12;

/// Finds the directions in which the residuals don't change, and marks their variables. A variable at its bound takes
/// part where the direction leads inside.
void name_open_directions(const LeastSquaresProblem& problem, std::span<const double> x,
                          const Eigen::Map<const RowMatrix>& normal, LeastSquaresSolution& solution) {
  std::vector<Eigen::Index> effective;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!solution.variables[i].identifiable) continue;
    effective.push_back(static_cast<Eigen::Index>(i));
    names.push_back(problem.names[i]);
  }
  if (effective.empty()) return;
  const Eigen::MatrixXd part = normal(effective, effective);
  const Eigen::VectorXd scale = part.diagonal().cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.cwiseInverse().asDiagonal() * part *
                                                             scale.cwiseInverse().asDiagonal());
  for (Eigen::Index k = 0; k < scale.size() && eigen.eigenvalues()[k] <= threshold; ++k) {
    const Eigen::VectorXd v = eigen.eigenvectors().col(k);
    bool forwards = true, backwards = true;
    for (Eigen::Index l = 0; l < v.size(); ++l) {
      const auto i = static_cast<std::size_t>(effective[static_cast<std::size_t>(l)]);
      if (!solution.variables[i].at_bound || std::abs(v[l]) <= 0.05) continue;
      const bool at_lower = x[i] - problem.lower[i] < problem.upper[i] - x[i];
      forwards = forwards && (at_lower == (v[l] > 0.0));
      backwards = backwards && (at_lower == (v[l] < 0.0));
    }
    if (!forwards && !backwards) continue;
    solution.identifiable = false;
    solution.remarks.push_back("the data don't decide " + direction_text(v.cwiseQuotient(scale).normalized(), names));
    for (Eigen::Index l = 0; l < v.size(); ++l) {
      if (std::abs(v[l]) > 0.05) {
        solution.variables[static_cast<std::size_t>(effective[static_cast<std::size_t>(l)])].identifiable = false;
      }
    }
  }
}

/// Σ r ∇²r between the `active` variables, by central differences of the gradient. How an optimum moves with the data
/// is the inverse of the whole Hessian JᵀJ + Σ r ∇²r: where a model can't meet the data, the second term counts.
Eigen::MatrixXd second_order(const LeastSquaresProblem& problem, std::span<const double> x,
                             const std::vector<Eigen::Index>& active) {
  const auto p = static_cast<Eigen::Index>(x.size());
  const auto m = static_cast<Eigen::Index>(active.size());
  std::vector<double> moved(x.begin(), x.end());
  const auto equations = [&](std::span<const double> at) {
    if (!problem.curvature_sample) return normal_equations(problem, at);
    NormalEquations result;
    problem.curvature_sample(at, true, result);
    return result;
  };
  const auto gradient = [&](std::size_t i, double value) {
    moved[i] = value;
    const NormalEquations at = equations(moved);
    moved[i] = x[i];
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(at.gradient.data(), p));
  };
  Eigen::MatrixXd hessian(m, m);
  for (Eigen::Index k = 0; k < m; ++k) {
    const auto i = static_cast<std::size_t>(active[static_cast<std::size_t>(k)]);
    const double room = std::min(problem.upper[i] - x[i], x[i] - problem.lower[i]);
    const double step = std::min(1e-5 * std::max(1e-2, std::abs(x[i])), 0.5 * room);
    const Eigen::VectorXd column = (gradient(i, x[i] + step) - gradient(i, x[i] - step)) / (2.0 * step);
    hessian.col(k) = column(active);
  }
  const NormalEquations here = equations(x);
  const Eigen::Map<const RowMatrix> normal(here.normal.data(), p, p);
  return 0.5 * (hessian + hessian.transpose()) - normal(active, active);
}

}  // namespace

LeastSquaresSolution analyse(const LeastSquaresProblem& problem, const Minimum& minimum) {
  const std::span<const double> x = minimum.x;
  const auto n = static_cast<Eigen::Index>(problem.residual_count);
  const auto p = static_cast<Eigen::Index>(x.size());
  LeastSquaresSolution solution;
  solution.converged = minimum.converged;
  solution.iterations = minimum.iterations;
  solution.termination = minimum.termination;
  solution.history = minimum.history;
  for (const double value : x) solution.variables.push_back({.value = value, .ci_low = value, .ci_high = value});
  const NormalEquations equations = normal_equations(problem, x);
  const Eigen::Map<const RowMatrix> normal(equations.normal.data(), p, p);
  solution.sum_of_squares = equations.sum_of_squares;

  // Variables that the errors can be computed for: not at a bound, and with an effect. A variable without effect is
  // one whose column vanishes against the largest, each scaled by its own range.
  std::vector<double> effect(x.size());
  double largest = 0.0;
  for (Eigen::Index k = 0; k < p; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const double range = problem.upper[i] - problem.lower[i];
    effect[i] = std::sqrt(normal(k, k)) * (std::isfinite(range) ? range : std::max(1.0, std::abs(x[i])));
    largest = std::max(largest, effect[i]);
  }
  std::vector<Eigen::Index> active;
  for (std::size_t i = 0; i < x.size(); ++i) {
    FittedVariable& variable = solution.variables[i];
    const double range = problem.upper[i] - problem.lower[i];
    const double near = std::isfinite(range) ? 1e-7 * range : 0.0;
    variable.at_bound = x[i] - problem.lower[i] <= near || problem.upper[i] - x[i] <= near;
    variable.identifiable = effect[i] > 1e-10 * largest;
    if (!variable.identifiable) {
      solution.remarks.push_back(problem.names[i] + " has no effect on these data: its value is the start value");
    } else if (variable.at_bound) {
      solution.remarks.push_back(fmt::format("{} is at its bound {:g}", problem.names[i], x[i]));
    } else {
      active.push_back(static_cast<Eigen::Index>(i));
    }
  }
  name_open_directions(problem, x, normal, solution);
  const auto m = static_cast<Eigen::Index>(active.size());
  solution.correlation.assign(x.size(), std::vector<double>(x.size(), 0.0));
  solution.inverse_normal = solution.correlation;
  if (problem.gradient_covariance) solution.covariance = solution.correlation;
  if (m == 0) {
    solution.identifiable = std::all_of(solution.variables.begin(), solution.variables.end(),
                                        [](const FittedVariable& v) { return v.identifiable; });
    return solution;
  }

  const Eigen::MatrixXd active_normal = normal(active, active);
  const Eigen::VectorXd scale = active_normal.diagonal().cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.cwiseInverse().asDiagonal() * active_normal *
                                                             scale.cwiseInverse().asDiagonal());
  const Eigen::VectorXd inverse_values =
      eigen.eigenvalues().unaryExpr([&](double v) { return v > threshold ? 1.0 / v : 0.0; });
  const Eigen::MatrixXd inverse_normal =
      scale.cwiseInverse().asDiagonal() *
      (eigen.eigenvectors() * inverse_values.asDiagonal() * eigen.eigenvectors().transpose()).eval() *
      scale.cwiseInverse().asDiagonal();
  solution.residual_variance = n > p ? solution.sum_of_squares / static_cast<double>(n - p) : 0.0;

  Eigen::MatrixXd data_covariance = Eigen::MatrixXd::Zero(m, m);
  if (problem.gradient_covariance) {
    const std::vector<double> flat = problem.gradient_covariance(x);
    const Eigen::Map<const RowMatrix> full(flat.data(), p, p);
    const Eigen::MatrixXd gradient_covariance = full(active, active);
    const Eigen::MatrixXd hessian = active_normal + second_order(problem, x, active);
    const Eigen::MatrixXd symmetric = scale.cwiseInverse().asDiagonal() * hessian * scale.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> curvature(symmetric);
    const Eigen::VectorXd inverse_curvature =
        curvature.eigenvalues().unaryExpr([&](double v) { return v > threshold ? 1.0 / v : 0.0; });
    const Eigen::MatrixXd inverse_hessian =
        scale.cwiseInverse().asDiagonal() *
        (curvature.eigenvectors() * inverse_curvature.asDiagonal() * curvature.eigenvectors().transpose()).eval() *
        scale.cwiseInverse().asDiagonal();
    data_covariance = inverse_hessian * gradient_covariance * inverse_hessian;
  }
  solution.quantile = problem.degrees_of_freedom > 0
                          ? boost::math::quantile(boost::math::students_t(problem.degrees_of_freedom), 0.975)
                          : boost::math::quantile(boost::math::normal(), 0.975);
  for (Eigen::Index k = 0; k < m; ++k) {
    const auto row = static_cast<std::size_t>(active[static_cast<std::size_t>(k)]);
    FittedVariable& variable = solution.variables[row];
    variable.misfit_standard_error = std::sqrt(solution.residual_variance * inverse_normal(k, k));
    variable.standard_error = std::sqrt(std::max(0.0, data_covariance(k, k)));
    variable.ci_low = variable.value - solution.quantile * variable.standard_error;
    variable.ci_high = variable.value + solution.quantile * variable.standard_error;
    for (Eigen::Index l = 0; l < m; ++l) {
      const auto column = static_cast<std::size_t>(active[static_cast<std::size_t>(l)]);
      const double product = inverse_normal(k, k) * inverse_normal(l, l);
      solution.correlation[row][column] = product > 0.0 ? inverse_normal(k, l) / std::sqrt(product) : 0.0;
      solution.inverse_normal[row][column] = inverse_normal(k, l);
      if (problem.gradient_covariance) solution.covariance[row][column] = data_covariance(k, l);
    }
  }
  for (const FittedVariable& variable : solution.variables) {
    solution.identifiable = solution.identifiable && variable.identifiable;
  }
  return solution;
}

namespace {

double sum_of_squares(const LeastSquaresProblem& problem, std::span<const double> x) {
  std::vector<double> residuals(problem.residual_count);
  if (!problem.evaluate(x, residuals, nullptr)) return std::numeric_limits<double>::infinity();
  return Eigen::Map<const Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size())).squaredNorm();
}

}  // namespace

Minimum minimise(const LeastSquaresProblem& problem, Monitor& monitor) {
  if (problem.condense) return minimise_in_box(problem, monitor);
  const std::size_t variables = problem.names.size();
  Minimum solution{.x = problem.start};
  std::vector<double>& x = solution.x;
  if (variables > 0) {
    Cache cache(problem, x.data(), monitor);
    // Ceres steps into a bound and projects; with the bound pressed against, its steps shrink until it takes standing
    // still for convergence. So a variable that the cost presses against its bound is held there, and let go once the
    // cost falls inwards.
    constexpr int for_good = 2;
    std::vector<int> held(variables, 0);
    for (std::size_t i = 0; i < problem.fixed.size(); ++i) held[i] = problem.fixed[i] != 0 ? for_good : 0;
    const auto most_passes = static_cast<int>(4 * variables + 4);
    for (int pass = 0; pass < most_passes; ++pass) {
      ceres::Problem::Options problem_options;
      problem_options.evaluation_callback = &cache;
      ceres::Problem ceres_problem(problem_options);
      for (std::size_t first = 0; first < cache.residuals.size(); first += residuals_per_block) {
        const std::size_t count = std::min(residuals_per_block, cache.residuals.size() - first);
        ceres_problem.AddResidualBlock(new Block(cache, first, count, variables), nullptr, x.data());
      }
      std::vector<int> constant;
      for (std::size_t i = 0; i < variables; ++i) {
        if (held[i] != 0) constant.push_back(static_cast<int>(i));
        if (std::isfinite(problem.lower[i]))
          ceres_problem.SetParameterLowerBound(x.data(), static_cast<int>(i), problem.lower[i]);
        if (std::isfinite(problem.upper[i]))
          ceres_problem.SetParameterUpperBound(x.data(), static_cast<int>(i), problem.upper[i]);
      }
      if (constant.size() == variables) {
        solution.converged = true;
        solution.termination = "every variable is held";
      } else {
        if (!constant.empty()) {
          ceres_problem.SetManifold(x.data(), new ceres::SubsetManifold(static_cast<int>(variables), constant));
        }
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::DENSE_QR;  // keeps the digits that ill-conditioned problems need
        options.max_num_iterations = std::max(1, problem.maximum_iterations - solution.iterations);
        options.function_tolerance = problem.tolerance;
        options.parameter_tolerance = 1e-13;
        options.gradient_tolerance = 1e-15;
        // Cubic steps would ask for a Jacobian at every trial.
        options.line_search_interpolation_type = ceres::QUADRATIC;
        options.num_threads = 1;
        options.logging_type = ceres::SILENT;
        options.update_state_every_iteration = true;
        Watch watch(cache, held, solution.history);
        options.callbacks.push_back(&watch);
        ceres::Solver::Summary summary;
        ceres::Solve(options, &ceres_problem, &summary);
        if (cache.failure) std::rethrow_exception(cache.failure);
        solution.converged =
            summary.termination_type == ceres::CONVERGENCE || summary.termination_type == ceres::USER_SUCCESS;
        solution.iterations += summary.num_successful_steps + summary.num_unsuccessful_steps;
        solution.termination = summary.message;
        if (!solution.converged || solution.iterations >= problem.maximum_iterations) break;
      }
      cache.PrepareForEvaluation(true, true);
      if (cache.failure) std::rethrow_exception(cache.failure);
      if (!cache.valid) break;
      bool changed = false;
      for (std::size_t i = 0; i < variables; ++i) {
        if (held[i] == for_good) continue;
        const int side = cache.pressed(i);
        changed = changed || side != held[i];
        held[i] = side;
      }
      if (!changed) break;
      solution.converged = false;  // unless the next pass says so
    }
  } else {
    solution.converged = true;
    solution.termination = "nothing was free";
  }
  solution.sum_of_squares = sum_of_squares(problem, x);
  return solution;
}

LeastSquaresSolution solve(const LeastSquaresProblem& problem, Monitor& monitor) {
  return analyse(problem, minimise(problem, monitor));
}

}  // namespace lobefit
