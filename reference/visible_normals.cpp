#include "reference/visible_normals.h"

#include <boost/math/special_functions/erf.hpp>

namespace lobefit {

namespace {

Direction sample_ggx(double alpha, const Direction& w, const std::array<double, 2>& u) {
  const Direction stretched = normalize(Direction{alpha * w.x, alpha * w.y, w.z});
  const double across = std::hypot(stretched.x, stretched.y);
  const Direction t1 = across > 0.0 ? Direction{-stretched.y / across, stretched.x / across, 0.0} : Direction{1.0, 0.0, 0.0};
  const Direction t2 = cross(stretched, t1);
  const double radius = std::sqrt(u[0]);
  const double phi = 2.0 * pi * u[1];
  const double p1 = radius * std::cos(phi);
  // The half disk behind the direction is foreshortened: warp the second coordinate onto what is visible.
  const double s = 0.5 * (1.0 + stretched.z);
  const double p2 = (1.0 - s) * std::sqrt(1.0 - p1 * p1) + s * radius * std::sin(phi);
  const Direction m = t1 * p1 + t2 * p2 + stretched * sqrt(1.0 - p1 * p1 - p2 * p2);
  return normalize(Direction{alpha * m.x, alpha * m.y, max(m.z, 0.0)});
}

/// Slope x of a unit-roughness Beckmann surface as seen under `cosine`: density ∝ (cos - x sin)⁺ exp(-x²).
double sample_visible_beckmann_slope(double cosine, double sine, double u) {
  const auto cumulative = [&](double x) {
    return 0.5 * (cosine * std::sqrt(pi) * std::erfc(-x) + sine * std::exp(-x * x));
  };
  // Beyond |x| = 7 the density is below 1e-21.
  double low = -7.0, high = sine > 0.0 ? std::min(7.0, cosine / sine) : 7.0;
  const double target = u * cumulative(high);
  double x = std::min(high, boost::math::erf_inv(2.0 * u - 1.0));
  // Newton from the unseen slope's quantile, kept inside a shrinking bracket.
  for (int iteration = 0; iteration < 60 && high - low > 1e-15; ++iteration) {
    const double excess = cumulative(x) - target;
    (excess > 0.0 ? high : low) = x;
    const double step = excess / ((cosine - x * sine) * std::exp(-x * x));
    const double next = x - step;
    // NaN and overshoots fall back to bisection.
    const double moved = next > low && next < high ? next : 0.5 * (low + high);
    if (std::abs(moved - x) < 1e-15) break;
    x = moved;
  }
  return x;
}

Direction sample_beckmann(double alpha, const Direction& w, const std::array<double, 2>& u) {
  const Direction stretched = normalize(Direction{alpha * w.x, alpha * w.y, w.z});
  const double sine = std::hypot(stretched.x, stretched.y);
  const double along = sample_visible_beckmann_slope(stretched.z, sine, u[0]);
  const double across = boost::math::erf_inv(2.0 * u[1] - 1.0);
  const double c = sine > 0.0 ? stretched.x / sine : 1.0;
  const double s = sine > 0.0 ? stretched.y / sine : 0.0;
  const double slope_x = alpha * (c * along - s * across);
  const double slope_y = alpha * (s * along + c * across);
  return normalize(Direction{-slope_x, -slope_y, 1.0});
}

}  // namespace

Direction sample_visible_normal(Distribution distribution, double alpha, const Direction& w,
                                const std::array<double, 2>& u) {
  return distribution == Distribution::ggx ? sample_ggx(alpha, w, u) : sample_beckmann(alpha, w, u);
}

}  // namespace lobefit
