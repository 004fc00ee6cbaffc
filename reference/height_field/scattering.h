// What is counted when light is followed over a rough surface of Lambertian facets, explicit or Smith's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "models/scalar.h"
#include "reference/sample_points.h"

namespace lobefit {

/// Orders of scattering, per unit of albedo to the power of the order. Order k is at index k - 1; the last index holds
/// all higher ones too, at unit albedo. Sums over paths, until divided by their number.
struct ScatteringOrders {
  ScatteringOrders(std::size_t count, std::size_t lights) : orders(count), brdf(count * lights), albedo(count) {}

  void add(const ScatteringOrders& other) {
    for (std::size_t i = 0; i < brdf.size(); ++i) brdf[i] += other.brdf[i];
    for (std::size_t i = 0; i < albedo.size(); ++i) albedo[i] += other.albedo[i];
    lost += other.lost;
  }
  void divide_by(double paths) {
    for (double& value : brdf) value /= paths;
    for (double& value : albedo) value /= paths;
  }

  std::size_t orders;
  std::vector<double> brdf;    // [order][light], 1/sr, by next-event estimation
  std::vector<double> albedo;  // [order]: the share of paths that escape after it, directional albedo of the fixed view
  std::uint64_t lost = 0;      // paths that rounding put below the surface
};

/// A direction with density cosine/π about m.
inline Direction cosine_direction(const Direction& m, const std::array<double, 2>& u) {
  // The unit sphere that touches the facet at the tail of m, seen from there.
  const double z = 1.0 - 2.0 * u[0], r = sqrt(1.0 - z * z), phi = 2.0 * pi * u[1];
  return normalize(m + Direction{r * std::cos(phi), r * std::sin(phi), z});
}

}  // namespace lobefit
