// Sampling of facet normals and of reflected directions, in double.
//
//   const Direction wi = sample_visible_reflection(Distribution::ggx, {0.2, 0.1}, wo, u);   // u in [0, 1)²
//   const double density = visible_reflection_density(Distribution::ggx, {0.2, 0.1}, wi, wo);
//
// Two densities, both per solid angle of m, w above the surface:
//   facets           D(m) cos θ_m                                  half-vector sampling
//   visible facets   D(m) (w·m)⁺ G1(w) / cos θ_w                   what w sees; leaves the weight F G2/G1
#pragma once

#include <array>

#include "models/geometry.h"
#include "models/microfacet/distribution.h"
#include "models/microfacet/normal_distribution.h"

namespace lobefit {

/// Inverse of the error function for |y| < 1; ±5.9 beyond what a double can tell from ±1.
inline double inverse_erf(double y) {
  const double clamped = min(max(y, -1.0 + 0x1p-53), 1.0 - 0x1p-53);
  // Winitzki's estimate, good to .002; each Halley step cubes that.
  constexpr double a = 0.147;
  const double w = std::log1p(-clamped * clamped);
  const double t = 2.0 / (pi * a) + 0.5 * w;
  double x = std::copysign(sqrt(std::sqrt(t * t - w / a) - t), clamped);
  for (int step = 0; step < 3; ++step) {
    // By the complement: erf itself can't tell the tails apart.
    const double excess = x < 0.0 ? std::erfc(-x) - (1.0 + clamped) : (1.0 - clamped) - std::erfc(x);
    const double newton = excess / (2.0 / std::sqrt(pi) * std::exp(-x * x));
    x -= newton / (1.0 + x * newton);
  }
  return x;
}

/// Facets of density D cos θ_m. Slopes of radius α tan θ: GGX √(u/(1 - u)), Beckmann √(-ln(1 - u)).
inline Direction sample_facet(Distribution distribution, Alpha alpha, const std::array<double, 2>& u) {
  const double radius =
      distribution == Distribution::ggx ? std::sqrt(u[0] / (1.0 - u[0])) : std::sqrt(-std::log1p(-u[0]));
  const double azimuth = 2.0 * pi * u[1];
  return normalize(Direction{alpha.x * radius * std::cos(azimuth), alpha.y * radius * std::sin(azimuth), 1.0});
}
inline double facet_sampling_density(Distribution distribution, Alpha alpha, const Direction& m) {
  if (m.z <= 0.0) return 0.0;
  const double d = distribution == Distribution::ggx ? GgxAnisotropicDistribution::evaluate(m, alpha.x, alpha.y)
                                                     : BeckmannAnisotropicDistribution::evaluate(m, alpha.x, alpha.y);
  return d * m.z;
}

/// Slope x of Beckmann facets with α = 1 as seen under `cosine`: density ∝ (cos - x sin)⁺ exp(-x²) (Heitz, d'Eon 2014,
/// Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals, supplement).
inline double sample_visible_beckmann_slope(double cosine, double sine, double u) {
  const auto cumulative = [&](double x) {
    return 0.5 * (cosine * std::sqrt(pi) * std::erfc(-x) + sine * std::exp(-x * x));
  };
  // Beyond |x| = 7 the density is below 1e-21.
  const double high = sine > 0.0 ? min(7.0, cosine / sine) : 7.0;
  double low = -7.0, upper = high;
  const double target = u * cumulative(high);
  double x = min(high, inverse_erf(2.0 * u - 1.0));
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

/// Facets that w sees, w above the surface. GGX: a disk mapped to the visible half of the stretched hemisphere (Heitz
/// 2018, Sampling the GGX Distribution of Visible Normals). Beckmann: the slope along w by inversion, the slope across
/// by the inverse error function.
inline Direction sample_visible_facet(Distribution distribution, Alpha alpha, const Direction& w,
                                      const std::array<double, 2>& u) {
  const Direction stretched = normalize(Direction{alpha.x * w.x, alpha.y * w.y, w.z});
  const double across = std::hypot(stretched.x, stretched.y);
  const double c = across > 0.0 ? stretched.x / across : 1.0;
  const double s = across > 0.0 ? stretched.y / across : 0.0;
  if (distribution == Distribution::ggx) {
    const Direction t1{-s, c, 0.0};
    const Direction t2 = cross(stretched, t1);
    const double radius = std::sqrt(u[0]), azimuth = 2.0 * pi * u[1];
    const double p1 = radius * std::cos(azimuth);
    // The half disk behind the direction is foreshortened: warp the second coordinate onto what is visible.
    const double lean = 0.5 * (1.0 + stretched.z);
    const double p2 = (1.0 - lean) * sqrt(1.0 - p1 * p1) + lean * radius * std::sin(azimuth);
    const Direction m = t1 * p1 + t2 * p2 + stretched * sqrt(1.0 - p1 * p1 - p2 * p2);
    return normalize(Direction{alpha.x * m.x, alpha.y * m.y, max(m.z, 0.0)});
  }
  const double slope_along = sample_visible_beckmann_slope(stretched.z, across, u[0]);
  const double slope_across = inverse_erf(2.0 * u[1] - 1.0);
  return normalize(
      Direction{-alpha.x * (c * slope_along - s * slope_across), -alpha.y * (s * slope_along + c * slope_across), 1.0});
}
inline double visible_facet_density(Distribution distribution, Alpha alpha, const Direction& w, const Direction& m) {
  if (m.z <= 0.0 || w.z <= 0.0) return 0.0;
  // facet_sampling_density has one cos θ_m too many.
  return facet_sampling_density(distribution, alpha, m) / m.z * max(dot(w, m), 0.0) /
         (w.z * (1.0 + smith_lambda(distribution, alpha, w)));
}

inline Direction reflect(const Direction& w, const Direction& m) { return m * (2.0 * dot(w, m)) - w; }

/// Density per solid angle of wi of reflecting wo at a facet of density `facet_density(m)`: over 4 wo·m.
template <class Density>
double reflected_density(const Direction& wi, const Direction& wo, Density&& facet_density) {
  const Direction m = normalize(wi + wo);
  const double cosine = dot(wo, m);
  return cosine > 0.0 ? facet_density(m) / (4.0 * cosine) : 0.0;
}

/// A mirror direction at any facet, whichever of its sides wo is on: no sample is lost.
inline Direction sample_reflection(Distribution distribution, Alpha alpha, const Direction& wo,
                                   const std::array<double, 2>& u) {
  return reflect(wo, sample_facet(distribution, alpha, u));
}
inline double reflection_density(Distribution distribution, Alpha alpha, const Direction& wi, const Direction& wo) {
  return reflected_density(wi, wo, [&](const Direction& m) {
    return facet_sampling_density(distribution, alpha, {m.x, m.y, abs(m.z)});
  });
}

/// A mirror direction at a facet that wo sees.
inline Direction sample_visible_reflection(Distribution distribution, Alpha alpha, const Direction& wo,
                                           const std::array<double, 2>& u) {
  return reflect(wo, sample_visible_facet(distribution, alpha, wo, u));
}
inline double visible_reflection_density(Distribution distribution, Alpha alpha, const Direction& wi,
                                         const Direction& wo) {
  return reflected_density(wi, wo,
                           [&](const Direction& m) { return visible_facet_density(distribution, alpha, wo, m); });
}

}  // namespace lobefit
