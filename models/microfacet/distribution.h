// Microfacet distributions, by the slopes of their facets.
//
// A facet normal m has slope t = tan theta_m, relative slope tau = t/alpha. The slope density P22 is normalised:
// ∫ P22 t dt dφ = ∫ D cos theta_m dm = 1. Lambda is Smith's: G1 = 1/(1 + Lambda) (Walter et al. 2007; Heitz 2014).
#pragma once

#include "models/scalar.h"

namespace lobefit {

enum class Distribution { ggx, beckmann };

/// alpha² P22 at relative slope tau.
inline double relative_slope_density(Distribution distribution, double tau) {
  const double tau2 = tau * tau;
  return distribution == Distribution::ggx ? 1.0 / (pi * (1.0 + tau2) * (1.0 + tau2)) : std::exp(-tau2) / pi;
}

/// Roughness along x and y; isotropic where they are one number.
struct Alpha {
  double x, y;

  Alpha(double both) : x(both), y(both) {}
  Alpha(double along_x, double along_y) : x(along_x), y(along_y) {}
};

/// Density D of facet normals per solid angle of m and unit of macro-surface area.
inline double facet_density(Distribution distribution, Alpha alpha, const Direction& m) {
  const double cos2 = m.z * m.z;
  const double tau = std::hypot(m.x / alpha.x, m.y / alpha.y) / m.z;
  return relative_slope_density(distribution, tau) / (alpha.x * alpha.y * cos2 * cos2);
}

/// Smith's Lambda of a direction above the surface.
inline double smith_lambda(Distribution distribution, Alpha alpha, const Direction& w) {
  const double stretched = std::sqrt(alpha.x * w.x * alpha.x * w.x + alpha.y * w.y * alpha.y * w.y);
  if (distribution == Distribution::ggx) {
    // (-1 + √(1 + α² tan²))/2 = α² sin² / (2 cos (cos + √(cos² + α² sin²))): no cancellation at normal incidence.
    return stretched * stretched / (2.0 * w.z * (w.z + std::sqrt(w.z * w.z + stretched * stretched)));
  }
  if (stretched == 0.0) return 0.0;
  const double a = w.z / stretched;
  return 0.5 * (std::exp(-a * a) / (a * std::sqrt(pi)) - std::erfc(a));
}

}  // namespace lobefit
