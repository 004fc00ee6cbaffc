#include "fit/box_steps.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace lobefit {

namespace {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The d that minimises g·d + ½ d·H d with lower ≤ d ≤ upper, H positive definite: a primal active-set method (Nocedal
/// & Wright 2006, Numerical Optimization, algorithm 16.3).
Eigen::VectorXd minimum_in_box(const Eigen::MatrixXd& h, const Eigen::VectorXd& g, const Eigen::VectorXd& lower,
                               const Eigen::VectorXd& upper) {
  const Eigen::Index p = g.size();
  Eigen::VectorXd d = Eigen::VectorXd::Zero(p);
  std::vector<char> held(static_cast<std::size_t>(p));
  for (Eigen::Index i = 0; i < p; ++i) {
    held[static_cast<std::size_t>(i)] =
        lower[i] >= upper[i] || (lower[i] >= 0.0 && g[i] > 0.0) || (upper[i] <= 0.0 && g[i] < 0.0);
  }
  for (Eigen::Index iteration = 0; iteration < 10 * p; ++iteration) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < p; ++i) {
      if (!held[static_cast<std::size_t>(i)]) free.push_back(i);
    }
    Eigen::VectorXd gradient = g + h * d;
    if (!free.empty()) {
      const Eigen::VectorXd part = gradient(free);
      const Eigen::VectorXd step = -h(free, free).ldlt().solve(part);
      // As far as the first bound.
      double share = 1.0;
      Eigen::Index blocking = -1;
      for (std::size_t k = 0; k < free.size(); ++k) {
        const Eigen::Index i = free[k];
        const double s = step[static_cast<Eigen::Index>(k)];
        const double room = (s > 0.0 ? upper[i] : lower[i]) - d[i];
        if (std::abs(s) * share > std::abs(room)) {
          share = std::abs(room / s);
          blocking = i;
        }
      }
      for (std::size_t k = 0; k < free.size(); ++k) d[free[k]] += share * step[static_cast<Eigen::Index>(k)];
      if (blocking >= 0) {
        d[blocking] = d[blocking] - lower[blocking] < upper[blocking] - d[blocking] ? lower[blocking] : upper[blocking];
        held[static_cast<std::size_t>(blocking)] = 1;
        continue;
      }
      gradient = g + h * d;
    }
    // Let go what the model pulls inwards most.
    Eigen::Index release = -1;
    double most = 0.0;
    for (Eigen::Index i = 0; i < p; ++i) {
      if (!held[static_cast<std::size_t>(i)] || lower[i] >= upper[i]) continue;
      const bool at_lower = d[i] <= lower[i];
      const double pull = (at_lower ? -gradient[i] : gradient[i]) / std::sqrt(h(i, i));
      if (pull > most) {
        most = pull;
        release = i;
      }
    }
    if (release < 0 || most < 1e-12 * g.norm()) break;
    held[static_cast<std::size_t>(release)] = 0;
  }
  return d.cwiseMax(lower).cwiseMin(upper);
}

}  // namespace

Minimum minimise_in_box(const LeastSquaresProblem& problem, Monitor& monitor) {
  const auto p = static_cast<Eigen::Index>(problem.names.size());
  Minimum minimum{.x = problem.start};
  NormalEquations here, there;
  monitor.check();
  if (!problem.condense(minimum.x, true, here)) {
    minimum.sum_of_squares = std::numeric_limits<double>::infinity();
    minimum.termination = "the model has no finite value at the start";
    return minimum;
  }
  minimum.history.push_back(std::sqrt(here.sum_of_squares));
  const double tolerance = std::max(problem.tolerance, 1e-12);  // the sums keep no more digits
  double damping = 1e-3, growth = 2.0;
  std::vector<double> x(minimum.x);
  Eigen::VectorXd lower(p), upper(p);
  for (; minimum.iterations < problem.maximum_iterations && !minimum.converged; ++minimum.iterations) {
    monitor.check();
    const Eigen::Map<const RowMatrix> normal(here.normal.data(), p, p);
    const Eigen::Map<const Eigen::VectorXd> gradient(here.gradient.data(), p);
    const double floor = 1e-12 * std::max(normal.diagonal().maxCoeff(), 1e-300);
    Eigen::MatrixXd damped = normal;
    damped.diagonal() += damping * normal.diagonal().cwiseMax(floor);
    for (Eigen::Index k = 0; k < p; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const bool fixed = !problem.fixed.empty() && problem.fixed[i] != 0;
      lower[k] = fixed ? 0.0 : problem.lower[i] - minimum.x[i];
      upper[k] = fixed ? 0.0 : problem.upper[i] - minimum.x[i];
    }
    const Eigen::VectorXd step = minimum_in_box(damped, gradient, lower, upper);
    const double predicted = -(2.0 * gradient.dot(step) + step.dot(normal * step));
    for (std::size_t i = 0; i < x.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      // Onto the bound itself, which a sum of differences may miss by a rounding.
      x[i] = step[k] == lower[k] && lower[k] < 0.0 ? problem.lower[i]
             : step[k] == upper[k] && upper[k] > 0.0
                 ? problem.upper[i]
                 : std::clamp(minimum.x[i] + step[k], problem.lower[i], problem.upper[i]);
    }
    const bool valid = problem.condense(x, false, there);
    const double gain = here.sum_of_squares - there.sum_of_squares;
    const double ratio = predicted > 0.0 ? gain / predicted : 0.0;
    const double enough = tolerance * here.sum_of_squares;
    if (valid && gain > 0.0 && ratio > 1e-4) {
      minimum.converged = gain <= enough && predicted <= enough;
      minimum.x = x;
      problem.condense(minimum.x, true, here);
      damping = std::max(1e-12, damping * std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * ratio - 1.0, 3.0)));
      growth = 2.0;
    } else {
      // Nielsen's growth. A step that neither gains nor promises anything is the end.
      minimum.converged = predicted <= 1e-3 * enough || damping > 1e12;
      damping *= growth;
      growth *= 2.0;
    }
    minimum.history.push_back(std::sqrt(here.sum_of_squares));
  }
  minimum.sum_of_squares = here.sum_of_squares;
  minimum.termination = minimum.converged ? "no step gains more than the tolerance" : "the iterations ran out";
  return minimum;
}

}  // namespace lobefit
