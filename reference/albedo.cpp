#include "reference/albedo.h"

#include <tbb/parallel_for.h>

#include <boost/math/quadrature/gauss.hpp>
#include <vector>

namespace lobefit {

namespace {

Rgb integrate(const std::function<Rgb(const Direction&, const Direction&)>& brdf, double theta, FixedDirection fixed,
              int panels) {
  const Direction still = direction(theta, 0.0);
  const int azimuths = 8 * panels;
  // Each panel is one term of a sum in fixed order.
  std::vector<Rgb> parts(static_cast<std::size_t>(panels));
  tbb::parallel_for(0, panels, [&](int panel) {
    const double width = 0.5 * pi / panels;
    Rgb sum;
    const auto ring = [&](double polar) {
      Rgb ring_sum;
      for (int k = 0; k < azimuths; ++k) {
        const Direction moving = direction(polar, 2.0 * pi * (k + 0.5) / azimuths);
        ring_sum = ring_sum + (fixed == FixedDirection::view ? brdf(moving, still) : brdf(still, moving));
      }
      return ring_sum * (2.0 * pi / azimuths * std::cos(polar) * std::sin(polar));
    };
    using Rule = boost::math::quadrature::gauss<double, 7>;
    const double middle = (panel + 0.5) * width;
    for (std::size_t i = 0; i < Rule::abscissa().size(); ++i) {
      const double offset = 0.5 * width * Rule::abscissa()[i];
      const double weight = 0.5 * width * Rule::weights()[i];
      sum = sum + ring(middle + offset) * weight;
      if (offset > 0.0) sum = sum + ring(middle - offset) * weight;
    }
    parts[static_cast<std::size_t>(panel)] = sum;
  });
  Rgb sum;
  for (const Rgb& part : parts) sum = sum + part;
  return sum;
}

}  // namespace

Albedo directional_albedo(const std::function<Rgb(const Direction&, const Direction&)>& brdf, double theta,
                          FixedDirection fixed, double tolerance) {
  Rgb coarse = integrate(brdf, theta, fixed, 1);
  for (int panels = 2;; panels *= 2) {
    const Rgb fine = integrate(brdf, theta, fixed, panels);
    const Rgb error{abs(fine.x - coarse.x), abs(fine.y - coarse.y), abs(fine.z - coarse.z)};
    const double worst = max(error.x, max(error.y, error.z));
    const double size = max(abs(fine.x), max(abs(fine.y), abs(fine.z)));
    if (worst <= tolerance * size || panels >= 256) return {fine, error};
    coarse = fine;
  }
}

}  // namespace lobefit
