#include "reference/specular/facets.h"

#include <limits>

#include "reference/visible_normals.h"

namespace lobefit {

namespace {

/// Visible normals of the unit-roughness GGX, a hemisphere: h = w + c is the half vector of w and of a direction c that
/// is uniform on the cap c.z > -w.z. Written so that nothing cancels near straight down, where the cap is a point.
Direction sample_hemisphere(const Direction& w, const std::array<double, 2>& u) {
  const double across2 = w.x * w.x + w.y * w.y;
  const double height = w.z > 0.0 ? 1.0 + w.z : across2 / (1.0 - w.z);  // of the cap
  const double z = (1.0 - u[0]) * height;                               // c.z + w.z
  const double radius = std::sqrt(max(u[0] * height * (1.0 - w.z + z), 0.0));
  const double azimuth = 2.0 * pi * u[1];
  return {radius * std::cos(azimuth) + w.x, radius * std::sin(azimuth) + w.y, z};
}

}  // namespace

double Facets::density(const Direction& m) const {
  if (!(m.z > 0.0)) return 0.0;
  const double x = m.x / alpha_x, y = m.y / alpha_y, z2 = m.z * m.z;
  if (distribution == Distribution::ggx) {
    const double stretched2 = x * x + y * y + z2;
    return 1.0 / (pi * alpha_x * alpha_y * stretched2 * stretched2);
  }
  const double slope2 = (x * x + y * y) / z2;
  if (!(slope2 < 700.0)) return 0.0;  // exp() underflows, 1/z⁴ may overflow
  return std::exp(-slope2) / (pi * alpha_x * alpha_y * z2 * z2);
}

double Facets::lambda(const Direction& w) const {
  if (!(w.z > 0.0)) return std::numeric_limits<double>::infinity();
  // Λ depends on the stretched tangent alone, so the length of its argument does not matter.
  const double sine = std::sqrt(w.x * w.x * (alpha_x * alpha_x) + w.y * w.y * (alpha_y * alpha_y));
  return smith_lambda(distribution, 1.0, {sine, 0.0, w.z});
}

double Facets::projected_area(const Direction& w) const {
  const Direction s = stretched(w);
  const double sine2 = s.x * s.x + s.y * s.y;
  if (distribution == Distribution::ggx) {
    const double length = std::sqrt(sine2 + s.z * s.z);
    return s.z > 0.0 ? 0.5 * (s.z + length) : 0.5 * sine2 / (length - s.z);
  }
  const double sine = std::sqrt(sine2);
  if (sine == 0.0) return max(s.z, 0.0);
  const double a = s.z / sine;
  return 0.5 * (sine * std::exp(-a * a) / std::sqrt(pi) + s.z * std::erfc(-a));
}

Direction Facets::sample_visible(const Direction& w, const std::array<double, 2>& u) const {
  const Direction s = normalize(stretched(w));
  // The inversion of the Beckmann slopes holds for directions below the horizon too: their slopes just end earlier.
  const Direction m = distribution == Distribution::ggx ? sample_hemisphere(s, u)
                                                        : sample_visible_normal(Distribution::beckmann, 1.0, s, u);
  return normalize(stretched(m));
}

}  // namespace lobefit
