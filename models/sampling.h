// What sampling is made of beside facets (models/microfacet/sampling.h): densities over the whole hemisphere or sphere,
// and lobes in shares.
#pragma once

#include <array>
#include <cstddef>

#include "models/geometry.h"

namespace lobefit {

/// By the cosine with z: density cos θ/π.
inline Direction sample_cosine(const std::array<double, 2>& u) {
  const double radius = std::sqrt(u[0]), azimuth = 2.0 * pi * u[1];
  return {radius * std::cos(azimuth), radius * std::sin(azimuth), std::sqrt(1.0 - u[0])};
}
inline double cosine_density(const Direction& w) { return max(w.z, 0.0) / pi; }

/// Base of models whose lobe covers the whole hemisphere: sampled by the cosine.
struct CosineSampling {
  template <class P>
  static Direction sample(const P&, const Direction&, const std::array<double, 2>& u) {
    return sample_cosine(u);
  }
  template <class P>
  static double pdf(const P&, const Direction& wi, const Direction&) {
    return cosine_density(wi);
  }
};

/// Base of models that rise up to 1/cos θ towards grazing light: density (2 cos θ + 1)/4π, half the cosine's and half
/// the uniform one's. By the cosine alone their weights have no bound; nor has the variance of those that rise whatever
/// the view.
struct GrazingSampling {
  template <class P>
  static Direction sample(const P&, const Direction&, const std::array<double, 2>& u) {
    // cos² θ + cos θ = 2 u.
    const double cosine = 4.0 * u[0] / (1.0 + std::sqrt(1.0 + 8.0 * u[0]));
    const double sine = std::sqrt((1.0 - cosine) * (1.0 + cosine)), azimuth = 2.0 * pi * u[1];
    return {sine * std::cos(azimuth), sine * std::sin(azimuth), cosine};
  }
  template <class P>
  static double pdf(const P&, const Direction& wi, const Direction&) {
    return wi.z > 0.0 ? (2.0 * wi.z + 1.0) / (4.0 * pi) : 0.0;
  }
};

/// Uniform over the sphere: density 1/4π.
inline Direction sample_sphere(const std::array<double, 2>& u) {
  const double z = 1.0 - 2.0 * u[0], radius = sqrt(1.0 - z * z), azimuth = 2.0 * pi * u[1];
  return {radius * std::cos(azimuth), radius * std::sin(azimuth), z};
}
inline constexpr double sphere_density = 1.0 / (4.0 * pi);

/// Picks a lobe by its share (shares add up to 1), and stretches u[0] over [0, 1) again for that lobe.
template <std::size_t n>
std::size_t pick_lobe(const std::array<double, n>& shares, std::array<double, 2>& u) {
  std::size_t lobe = 0;
  while (lobe + 1 < n && u[0] >= shares[lobe]) u[0] -= shares[lobe++];
  u[0] = min(u[0] / max(shares[lobe], smallest_base), 1.0 - 0x1p-53);
  return lobe;
}

}  // namespace lobefit
