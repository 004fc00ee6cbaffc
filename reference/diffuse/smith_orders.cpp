#include "reference/diffuse/smith_orders.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>

namespace lobefit {

namespace {

/// Gauss-Legendre nodes and weights on [0, 1], by Newton's method on the Legendre polynomial.
void gauss_legendre(int n, std::vector<double>& x, std::vector<double>& w) {
  x.resize(static_cast<std::size_t>(n));
  w.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    double z = std::cos(pi * (i + 0.75) / (n + 0.5)), slope = 1.0;
    for (int iteration = 0; iteration < 100; ++iteration) {
      double p = 1.0, before = 0.0;
      for (int k = 1; k <= n; ++k) {
        const double older = before;
        before = p;
        p = ((2.0 * k - 1.0) * z * before - (k - 1.0) * older) / k;
      }
      slope = n * (z * p - before) / (z * z - 1.0);
      const double step = p / slope;
      z -= step;
      if (std::abs(step) < 1e-15) break;
    }
    x[static_cast<std::size_t>(i)] = 0.5 * (1.0 - z);
    w[static_cast<std::size_t>(i)] = 1.0 / ((1.0 - z * z) * slope * slope);
  }
}

/// Λ of a direction above the horizon, by its polar cosine.
double lambda_of(Distribution distribution, double alpha, double mu) {
  return smith_lambda(distribution, alpha, {std::sqrt((1.0 - mu) * (1.0 + mu)), 0.0, mu});
}

}  // namespace

// Facet slopes are t = α cot x, as in shared_visibility(): x = 0 are the steepest.
SmithOrders::SlopeRule SmithOrders::slope_rule(double extra_knot) const {
  std::vector<double> knots = knots_;
  knots.insert(std::upper_bound(knots.begin(), knots.end(), extra_knot), extra_knot);
  std::vector<double> s, ws;
  gauss_legendre(resolution_.slopes, s, ws);
  SlopeRule rule;
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    const double width = knots[k + 1] - knots[k];
    if (width <= 0.0) continue;
    for (std::size_t j = 0; j < s.size(); ++j) {
      // Facets steeper than a knot turn away in part, over an arc that opens as the square root of the distance:
      // quadratic in s towards the upper end, all integrands are smooth.
      const double x = knots[k + 1] - width * s[j] * s[j];
      double density = 1.0 / (std::sin(x) * std::sin(x));  // of relative slopes τ = cot x: dτ = dx / sin²x
      const double tau = std::cos(x) / std::sin(x);
      density *= 2.0 * pi * relative_slope_density(distribution_, tau) * tau;
      const double weight = 2.0 * width * s[j] * ws[j] * density;
      if (!(weight > 0.0)) continue;
      rule.x.push_back(x);
      rule.weight.push_back(weight);
    }
  }
  return rule;
}

SmithOrders::Matrix SmithOrders::visible_modes(double mu, const SlopeRule& rule) const {
  const double sine = std::sqrt((1.0 - mu) * (1.0 + mu));
  Matrix result = Matrix::Zero(resolution_.modes, static_cast<Eigen::Index>(rule.x.size()));
  for (std::size_t q = 0; q < rule.x.size(); ++q) {
    const double run = std::sin(rule.x[q]), rise = alpha_ * std::cos(rule.x[q]);
    const double length = std::sqrt(run * run + rise * rise);
    // D dm = P22 t dt dφ / cosθ_m; κ shares the 1/(π cosθ_m) between its two factors.
    const double scale = std::sqrt(rule.weight[q] * length / run / pi) / length;
    const double a = mu * run * scale, b = sine * rise * scale;
    auto modes = result.col(static_cast<Eigen::Index>(q));
    if (a <= -b) continue;
    if (a >= b) {
      modes(0) = a;
      if (modes.size() > 1) modes(1) = 0.5 * b;
      continue;
    }
    const double edge = std::acos(-a / b);
    // sin(kψ) by its recurrence, stable on this range.
    const double c = std::cos(edge), s1 = std::sin(edge);
    double below = 0.0, here = s1, above = 2.0 * c * s1;  // k = 0, 1, 2
    modes(0) = (a * edge + b * s1) / pi;
    if (modes.size() > 1) modes(1) = (a * s1 + 0.5 * b * (edge + 0.5 * above)) / pi;
    for (int k = 2; k < resolution_.modes; ++k) {
      below = here;
      here = above;
      above = 2.0 * c * here - below;
      modes(k) = (a * here / k + 0.5 * b * (below / (k - 1.0) + above / (k + 1.0))) / pi;
    }
  }
  return result;
}

double SmithOrders::scale(double mu_a, double lambda_a, double mu_b, double lambda_b) const {
  return 1.0 / ((1.0 + lambda_a + lambda_b) * mu_a * mu_b);
}

SmithOrders::SmithOrders(Distribution distribution, double alpha, int most_orders, const Resolution& resolution)
    : distribution_(distribution), alpha_(alpha), resolution_(resolution) {
  const Eigen::Index n = resolution.polar;
  std::vector<double> s, ws;
  gauss_legendre(resolution.polar, s, ws);
  mu_.resize(n), weight_.resize(n), lambda_.resize(n);
  // Everything changes over μ ≈ α near the horizon.
  const double stretch = std::asinh(1.0 / alpha);
  knots_ = {0.0, pi / 2.0};
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t k = static_cast<std::size_t>(i);
    mu_(i) = alpha * std::sinh(stretch * s[k]);
    weight_(i) = 2.0 * pi * ws[k] * stretch * alpha * std::cosh(stretch * s[k]);
    lambda_(i) = lambda_of(distribution, alpha, mu_(i));
    knots_.push_back(std::atan2(alpha * std::sqrt((1.0 - mu_(i)) * (1.0 + mu_(i))), mu_(i)));
  }
  std::sort(knots_.begin(), knots_.end());

  const SlopeRule rule = slope_rule(pi / 2.0);
  const auto slopes = static_cast<Eigen::Index>(rule.x.size());
  std::vector<Matrix> up(static_cast<std::size_t>(resolution.modes), Matrix(n, slopes)), down = up;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Matrix above = visible_modes(mu_(i), rule), below = visible_modes(-mu_(i), rule);
    for (int m = 0; m < resolution.modes; ++m) {
      up[static_cast<std::size_t>(m)].row(i) = above.row(m);
      // -u lies half a turn from u.
      down[static_cast<std::size_t>(m)].row(i) = (m % 2 == 0 ? 1.0 : -1.0) * below.row(m);
    }
  }
  Matrix scales(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) scales(i, j) = scale(mu_(i), lambda_(i), mu_(j), lambda_(j));
  }
  modes_.resize(static_cast<std::size_t>(resolution.modes));
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    Mode& mode = modes_[m];
    // Weights of a falling direction go with it; those of ∫ dμ dφ hold the 2π of the convolution over azimuths.
    mode.down_up = weight_.asDiagonal() * (down[m] * up[m].transpose());
    mode.down_down = weight_.asDiagonal() * (down[m] * down[m].transpose()) * weight_.asDiagonal();
    mode.f.resize(1);
    mode.back.resize(1);
    mode.f.push_back((up[m] * up[m].transpose()).cwiseProduct(scales));
    mode.back.push_back(mode.down_down * mode.f[1]);
  }
  orders_ = 1;
  while (orders_ < most_orders) {
    const std::size_t order = static_cast<std::size_t>(orders_) + 1;
    for (Mode& mode : modes_) {
      const Matrix half = mode.f[order - 1] * mode.down_up;  // ∫ f_{n-1}(o, u) κ(-u, i) du
      Matrix sum = mu_.asDiagonal() * half;
      sum += half.transpose() * mu_.asDiagonal();
      Matrix twice = Matrix::Zero(n, n);
      for (std::size_t j = 1; j + 1 < order; ++j) twice += mode.f[j] * mode.back[order - 1 - j];
      sum += mu_.asDiagonal() * twice * mu_.asDiagonal();
      mode.f.push_back(sum.cwiseProduct(scales));
      mode.back.push_back(mode.down_down * mode.f[order]);
    }
    ++orders_;
    const Vector reflected = modes_[0].f[order].transpose() * mu_.cwiseProduct(weight_);
    if (reflected.maxCoeff() < 1e-11) break;
  }
}

std::shared_ptr<const SmithOrders::Row> SmithOrders::row(double mu) const {
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = rows_.find(mu); found != rows_.end()) return found->second;
  }
  const auto result = std::make_shared<Row>();
  result->mu = mu;
  result->lambda = lambda_of(distribution_, alpha_, mu);
  const SlopeRule rule = slope_rule(std::atan2(alpha_ * std::sqrt((1.0 - mu) * (1.0 + mu)), mu));
  const Matrix own = visible_modes(mu, rule);
  const Eigen::Index n = mu_.size();
  const std::size_t mode_count = modes_.size();
  result->down_up.assign(mode_count, Vector(n));
  std::vector<Vector> up(mode_count, Vector(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const Matrix above = visible_modes(mu_(i), rule), below = visible_modes(-mu_(i), rule);
    for (std::size_t m = 0; m < mode_count; ++m) {
      const auto line = static_cast<Eigen::Index>(m);
      up[m](i) = above.row(line).dot(own.row(line));
      result->down_up[m](i) = (m % 2 == 0 ? 1.0 : -1.0) * below.row(line).dot(own.row(line)) * weight_(i);
    }
  }
  Vector scales(n);
  for (Eigen::Index i = 0; i < n; ++i) scales(i) = scale(mu, result->lambda, mu_(i), lambda_(i));
  result->f.assign(mode_count, Matrix::Zero(n, orders_ + 1));
  result->back.resize(mode_count);
  for (std::size_t m = 0; m < mode_count; ++m) {
    const Mode& mode = modes_[m];
    Matrix& f = result->f[m];
    f.col(1) = up[m].cwiseProduct(scales);
    for (Eigen::Index order = 2; order <= orders_; ++order) {
      const auto before = static_cast<std::size_t>(order) - 1;
      Vector sum = (mode.f[before].transpose() * result->down_up[m]).cwiseProduct(mu_);
      sum += mu * (mode.down_up.transpose() * f.col(order - 1));
      Vector twice = Vector::Zero(n);
      for (Eigen::Index k = 1; k + 1 < order; ++k) {
        twice += mode.back[before - static_cast<std::size_t>(k)].transpose() * f.col(k);
      }
      sum += mu * twice.cwiseProduct(mu_);
      f.col(order) = sum.cwiseProduct(scales);
    }
    result->back[m] = mode.down_down * f;
  }
  const std::lock_guard lock(mutex_);
  return rows_.emplace(mu, result).first->second;
}

SmithOrders::Matrix SmithOrders::azimuthal_modes(double mu_a, double mu_b) const {
  const std::shared_ptr<const Row> a = row(mu_a), b = row(mu_b);
  const double scaling = scale(a->mu, a->lambda, b->mu, b->lambda);
  Matrix result = Matrix::Zero(static_cast<Eigen::Index>(modes_.size()), orders_ + 1);
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    const Vector from_b = b->f[m].transpose() * a->down_up[m], from_a = a->f[m].transpose() * b->down_up[m];
    const Matrix twice = a->f[m].transpose() * b->back[m];
    for (Eigen::Index order = 2; order <= orders_; ++order) {
      double sum = b->mu * from_b(order - 1) + a->mu * from_a(order - 1);
      for (Eigen::Index k = 1; k + 1 < order; ++k) sum += a->mu * b->mu * twice(k, order - 1 - k);
      result(static_cast<Eigen::Index>(m), order) = (m == 0 ? 1.0 : 2.0) * scaling * sum;
    }
  }
  return result;
}

std::vector<double> SmithOrders::evaluate(std::span<const Direction> wi, const Direction& wo) const {
  std::vector<double> result(static_cast<std::size_t>(orders_) * wi.size(), 0.0);
  Matrix modes;
  for (std::size_t j = 0; j < wi.size(); ++j) {
    if (j == 0 || wi[j].z != wi[j - 1].z) modes = azimuthal_modes(wo.z, wi[j].z);
    const double sine_product = std::hypot(wi[j].x, wi[j].y) * std::hypot(wo.x, wo.y);
    const double cosine =
        sine_product > 0.0 ? std::clamp((wi[j].x * wo.x + wi[j].y * wo.y) / sine_product, -1.0, 1.0) : 1.0;
    Vector waves(modes.rows());
    for (Eigen::Index m = 0; m < waves.size(); ++m) waves(m) = std::cos(static_cast<double>(m) * std::acos(cosine));
    const Vector orders = modes.transpose() * waves;
    for (std::size_t n = 1; n < static_cast<std::size_t>(orders_); ++n) {
      result[n * wi.size() + j] = orders(static_cast<Eigen::Index>(n) + 1);
    }
  }
  return result;
}

std::vector<double> SmithOrders::evaluate(const Direction& wi, const Direction& wo) const {
  return evaluate({&wi, 1}, wo);
}

std::vector<double> SmithOrders::albedo(double mu) const {
  const std::shared_ptr<const Row> a = row(mu);
  std::vector<double> result;
  for (Eigen::Index order = 1; order <= orders_; ++order) {
    result.push_back(a->f[0].col(order).dot(mu_.cwiseProduct(weight_)));
  }
  return result;
}

}  // namespace lobefit
