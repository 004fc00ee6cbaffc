#include "evaluate/metallic_surface.h"

#include <algorithm>
#include <boost/math/tools/roots.hpp>

#include "models/scalar.h"

namespace lobefit {

namespace {

/// What more metallic has to gain, as a sum of squares: a hundred-thousandth in reflectance, far below a byte.
constexpr double least_gain = 1e-10;

/// The best of one metallic m. For a given dielectric_f0 s, the best base colour is closed; and the sum of squares that
/// is left is convex in s, with the derivative 2 (1 - m) Σ (f0 that it has - f0).
MetallicSurface nearest_of(double metallic, const MetallicSurface::Color& albedo, const MetallicSurface::Color& f0) {
  const double rest = 1.0 - metallic;
  const auto with = [&](double s) {
    MetallicSurface surface{.dielectric_f0 = s, .metallic = metallic};
    for (std::size_t c = 0; c < 3; ++c) {
      const double base = (rest * albedo[c] + metallic * (f0[c] - rest * s)) / (square(rest) + square(metallic));
      surface.base_color[c] = std::clamp(base, 0.0, 1.0);
    }
    return surface;
  };
  const auto slope = [&](double s) {
    const MetallicSurface::Color has = with(s).f0();
    return rest * (has[0] - f0[0] + has[1] - f0[1] + has[2] - f0[2]);
  };
  if (slope(0.0) >= 0.0) return with(0.0);
  if (slope(largest_dielectric_f0) <= 0.0) return with(largest_dielectric_f0);
  const auto [lower, upper] =
      boost::math::tools::bisect(slope, 0.0, largest_dielectric_f0, boost::math::tools::eps_tolerance<double>(50));
  return with(0.5 * (lower + upper));
}

double distance(const MetallicSurface& surface, const MetallicSurface::Color& albedo,
                const MetallicSurface::Color& f0) {
  const MetallicSurface::Color has_albedo = surface.albedo(), has_f0 = surface.f0();
  double sum = 0.0;
  for (std::size_t c = 0; c < 3; ++c) sum += square(has_albedo[c] - albedo[c]) + square(has_f0[c] - f0[c]);
  return sum;
}

}  // namespace

MetallicSurface::Color MetallicSurface::albedo() const {
  Color color;
  for (std::size_t c = 0; c < 3; ++c) color[c] = base_color[c] * (1.0 - metallic);
  return color;
}

MetallicSurface::Color MetallicSurface::f0() const {
  Color color;
  for (std::size_t c = 0; c < 3; ++c) color[c] = dielectric_f0 * (1.0 - metallic) + base_color[c] * metallic;
  return color;
}

MetallicSurface MetallicSurface::nearest(const Color& albedo, const Color& f0) {
  MetallicSurface best = nearest_of(0.0, albedo, f0);
  for (int step = 1; step <= 255; ++step) {
    const MetallicSurface next = nearest_of(step / 255.0, albedo, f0);
    if (distance(next, albedo, f0) < distance(best, albedo, f0) - least_gain) best = next;
  }
  return best;
}

}  // namespace lobefit
