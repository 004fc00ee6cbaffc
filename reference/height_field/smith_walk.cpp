#include "reference/height_field/smith_walk.h"

#include <algorithm>
#include <cmath>

namespace lobefit {

namespace {

/// Slope x along w of a unit-roughness Beckmann surface: density ∝ (cosine - x sine)⁺ exp(-x²).
double visible_slope(double cosine, double sine, double u) {
  const auto cumulative = [&](double x) {
    return 0.5 * (cosine * std::sqrt(pi) * std::erfc(-x) + sine * std::exp(-x * x));
  };
  // Facets beyond slope 7 are fewer than 1 in 1e21. A ray that rises so steeply that it sees only those meets none.
  double high = sine > 0.0 ? min(7.0, cosine / sine) : 7.0;
  double low = min(-7.0, high - 1.0);
  const double target = u * cumulative(high);
  // Halved 48 times: 5e-14.
  for (int step = 0; step < 48; ++step) {
    const double middle = 0.5 * (low + high);
    (cumulative(middle) < target ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

Direction smith_visible_normal(Distribution distribution, double alpha, const Direction& w, double u,
                               const std::array<double, 2>& v) {
  const Direction stretched = normalize(Direction{alpha * w.x, alpha * w.y, w.z});
  if (distribution == Distribution::ggx) {
    // Reflections of w off the upper hemisphere are uniform over the cap z > -w.z.
    const double z = (1.0 - v[0]) * (1.0 + stretched.z) - stretched.z;
    const double r = sqrt(1.0 - z * z), phi = 2.0 * pi * v[1];
    const Direction m = Direction{r * std::cos(phi), r * std::sin(phi), z} + stretched;
    return normalize(Direction{alpha * m.x, alpha * m.y, max(m.z, 0.0)});
  }
  const double sine = std::hypot(stretched.x, stretched.y);
  const double c = sine > 0.0 ? stretched.x / sine : 1.0, s = sine > 0.0 ? stretched.y / sine : 0.0;
  const double along = visible_slope(stretched.z, sine, u);
  const double across = std::sqrt(-std::log(v[0])) * std::cos(2.0 * pi * v[1]);
  return normalize(Direction{-alpha * (c * along - s * across), -alpha * (s * along + c * across), 1.0});
}

void add_smith_walks(Distribution distribution, double alpha, const Direction& wo, std::span<const Direction> wi,
                     const SamplePoints& points, std::uint32_t first, std::uint32_t count, ScatteringOrders& sums) {
  std::vector<double> lambda_i;
  for (const Direction& w : wi) lambda_i.push_back(smith_lambda(distribution, alpha, w));
  for (std::uint32_t path = first; path < first + count; ++path) {
    PathNumbers numbers(points, path);
    Direction w = -wo;
    double tau = 0.0;
    for (std::size_t order = 0;; ++order) {
      const std::array<double, 2> free_path = numbers.next_pair();
      if (w.z < 0.0) {
        tau -= std::log(free_path[0]) / (1.0 + smith_lambda(distribution, alpha, -w));
      } else {
        tau += std::log(free_path[0]) / smith_lambda(distribution, alpha, w);
        if (!(tau > 0.0)) {
          sums.albedo[std::min(order, sums.orders) - 1] += 1.0;
          break;
        }
      }
      const Direction m = smith_visible_normal(distribution, alpha, -w, free_path[1], numbers.next_pair());
      const std::size_t index = std::min(order, sums.orders - 1);
      for (std::size_t j = 0; j < wi.size(); ++j) {
        const double cosine = dot(m, wi[j]);
        if (cosine > 0.0) {
          sums.brdf[index * wi.size() + j] += cosine * std::exp(-tau * lambda_i[j]) / (pi * wi[j].z);
        }
      }
      w = cosine_direction(m, numbers.next_pair());
    }
  }
}

}  // namespace lobefit
