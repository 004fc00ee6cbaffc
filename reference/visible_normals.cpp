#include "reference/visible_normals.h"

#include <boost/math/special_functions/erf.hpp>

#include "models/float_functions.h"
#include "models/instruction_sets.h"

namespace lobefit {

namespace {

/// cos and sin of u turns, 0 ≤ u ≤ 1, by Taylor polynomials on |x| ≤ π/4: absolute error below 3e-16, and the same bits
/// on every machine, vectorised or not.
LOBEFIT_TEXT void cosine_and_sine_of_turns(double u, double& cosine, double& sine) {
  const int quarter = static_cast<int>(4.0 * u + 0.5);
  const double x = (u - 0.25 * quarter) * (2.0 * pi);
  const double x2 = x * x;
  double s = -1.0 / 1307674368000.0;
  s = s * x2 + 1.0 / 6227020800.0;
  s = s * x2 - 1.0 / 39916800.0;
  s = s * x2 + 1.0 / 362880.0;
  s = s * x2 - 1.0 / 5040.0;
  s = s * x2 + 1.0 / 120.0;
  s = s * x2 - 1.0 / 6.0;
  s = x + x * x2 * s;
  double c = 1.0 / 20922789888000.0;
  c = c * x2 - 1.0 / 87178291200.0;
  c = c * x2 + 1.0 / 479001600.0;
  c = c * x2 - 1.0 / 3628800.0;
  c = c * x2 + 1.0 / 40320.0;
  c = c * x2 - 1.0 / 720.0;
  c = c * x2 + 1.0 / 24.0;
  c = c * x2 - 0.5;
  c = 1.0 + x2 * c;
  const bool odd = (quarter & 1) != 0;
  const double a = odd ? s : c;
  const double b = odd ? c : s;
  cosine = ((quarter + 1) & 2) != 0 ? -a : a;
  sine = (quarter & 2) != 0 ? -b : b;
}

/// What all GGX facets of one direction share.
struct GgxView {
  Alpha alpha;
  Direction stretched, t1, t2;
};

GgxView make_ggx_view(Alpha alpha, const Direction& w) {
  const Direction stretched = normalize(Direction{alpha.x * w.x, alpha.y * w.y, w.z});
  const double across = std::hypot(stretched.x, stretched.y);
  const Direction t1 =
      across > 0.0 ? Direction{-stretched.y / across, stretched.x / across, 0.0} : Direction{1.0, 0.0, 0.0};
  return {alpha, stretched, t1, cross(stretched, t1)};
}

LOBEFIT_TEXT Direction sample_ggx(const GgxView& view, double u, double v) {
  double cosine, sine;
  cosine_and_sine_of_turns(v, cosine, sine);
  const double radius = sqrt(u);
  const double p1 = radius * cosine;
  // The half disk behind the direction is foreshortened: warp the second coordinate onto what is visible.
  const double s = 0.5 * (1.0 + view.stretched.z);
  const double p2 = (1.0 - s) * sqrt(1.0 - p1 * p1) + s * radius * sine;
  const Direction m = view.t1 * p1 + view.t2 * p2 + view.stretched * sqrt(1.0 - p1 * p1 - p2 * p2);
  return normalize(Direction{view.alpha.x * m.x, view.alpha.y * m.y, max(m.z, 0.0)});
}

/// sample_ggx() in float.
LOBEFIT_CLONES [[gnu::noinline]] void fill_ggx(const GgxView& view, std::size_t n, const float* __restrict u,
                                               const float* __restrict v, float* __restrict x, float* __restrict y,
                                               float* __restrict z) {
  const auto alpha_x = static_cast<float>(view.alpha.x), alpha_y = static_cast<float>(view.alpha.y);
  const auto ex = static_cast<float>(view.stretched.x), ey = static_cast<float>(view.stretched.y),
             ez = static_cast<float>(view.stretched.z);
  const auto t1x = static_cast<float>(view.t1.x), t1y = static_cast<float>(view.t1.y);
  const auto t2x = static_cast<float>(view.t2.x), t2y = static_cast<float>(view.t2.y),
             t2z = static_cast<float>(view.t2.z);
  const float s = 0.5f * (1.0f + ez);
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    float cosine, sine;
    float_cosine_and_sine_of_turns(v[i], cosine, sine);
    const float radius = __builtin_sqrtf(u[i]);
    const float p1 = radius * cosine;
    const float left = 1.0f - p1 * p1;
    const float p2 = (1.0f - s) * __builtin_sqrtf(left > 0.0f ? left : 0.0f) + s * radius * sine;
    const float rest = left - p2 * p2;
    const float p3 = __builtin_sqrtf(rest > 0.0f ? rest : 0.0f);
    const float mx = alpha_x * (t1x * p1 + t2x * p2 + ex * p3);
    const float my = alpha_y * (t1y * p1 + t2y * p2 + ey * p3);
    const float up = t2z * p2 + ez * p3;
    const float mz = up > 0.0f ? up : 0.0f;
    const float length = 1.0f / __builtin_sqrtf(mx * mx + my * my + mz * mz);
    x[i] = mx * length, y[i] = my * length, z[i] = mz * length;
  }
}

/// Slope x of a unit-roughness Beckmann surface as seen under `cosine`: density ∝ (cos - x sin)⁺ exp(-x²).
double sample_visible_beckmann_slope(double cosine, double sine, double u) {
  const auto cumulative = [&](double x) {
    return 0.5 * (cosine * std::sqrt(pi) * std::erfc(-x) + sine * std::exp(-x * x));
  };
  // Beyond |x| = 7 the density is below 1e-21.
  const double high = sine > 0.0 ? std::min(7.0, cosine / sine) : 7.0;
  double low = std::min(-7.0, high - 1.0), upper = high;
  const double target = u * cumulative(high);
  double x = std::min(high, boost::math::erf_inv(2.0 * u - 1.0));
  // Newton from the unseen slope's quantile, kept inside a shrinking bracket.
  for (int iteration = 0; iteration < 60 && upper - low > 1e-15; ++iteration) {
    const double excess = cumulative(x) - target;
    (excess > 0.0 ? upper : low) = x;
    const double step = excess / ((cosine - x * sine) * std::exp(-x * x));
    const double next = x - step;
    // Newton's error after a step this small is below rounding.
    if (std::abs(step) < 1e-10) return next;
    // NaN and overshoots fall back to bisection.
    x = next > low && next < upper ? next : 0.5 * (low + upper);
  }
  return x;
}

Direction sample_beckmann(Alpha alpha, const Direction& w, const std::array<double, 2>& u) {
  const Direction stretched = normalize(Direction{alpha.x * w.x, alpha.y * w.y, w.z});
  const double sine = std::hypot(stretched.x, stretched.y);
  const double along = sample_visible_beckmann_slope(stretched.z, sine, u[0]);
  const double across = boost::math::erf_inv(2.0 * u[1] - 1.0);
  const double c = sine > 0.0 ? stretched.x / sine : 1.0;
  const double s = sine > 0.0 ? stretched.y / sine : 0.0;
  const double slope_x = alpha.x * (c * along - s * across);
  const double slope_y = alpha.y * (s * along + c * across);
  return normalize(Direction{-slope_x, -slope_y, 1.0});
}

}  // namespace

Direction sample_visible_normal(Distribution distribution, Alpha alpha, const Direction& w,
                                const std::array<double, 2>& u) {
  return distribution == Distribution::ggx ? sample_ggx(make_ggx_view(alpha, w), u[0], u[1])
                                           : sample_beckmann(alpha, w, u);
}

void sample_visible_normals(Distribution distribution, Alpha alpha, const Direction& w, std::span<const float> u,
                            std::span<const float> v, const FacetBatch& facets) {
  if (distribution == Distribution::ggx) {
    return fill_ggx(make_ggx_view(alpha, w), u.size(), u.data(), v.data(), facets.x.data(), facets.y.data(),
                    facets.z.data());
  }
  for (std::size_t i = 0; i < u.size(); ++i) {
    const Direction m = sample_beckmann(alpha, w, {u[i], v[i]});
    facets.x[i] = static_cast<float>(m.x), facets.y[i] = static_cast<float>(m.y), facets.z[i] = static_cast<float>(m.z);
  }
}

}  // namespace lobefit
