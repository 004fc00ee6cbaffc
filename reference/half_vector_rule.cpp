#include "reference/half_vector_rule.h"

#include <boost/math/quadrature/gauss.hpp>

namespace lobefit {

HalfVectorRule::HalfVectorRule(int n) : azimuths_(32 * n) {
  using Rule = boost::math::quadrature::gauss<double, 16>;
  const double half = 0.5 / n;
  for (int panel = 0; panel < n; ++panel) {
    const double middle = (2 * panel + 1) * half;
    for (std::size_t i = 0; i < Rule::abscissa().size(); ++i) {
      for (const double sign : {-1.0, 1.0}) {
        u_.push_back(middle + sign * half * Rule::abscissa()[i]);
        weight_.push_back(half * Rule::weights()[i]);
      }
    }
  }
}

std::vector<LightNode> HalfVectorRule::lights(const Direction& wo) const {
  const double sin_o = std::hypot(wo.x, wo.y);
  const double cos_azimuth = sin_o > 0.0 ? wo.x / sin_o : 1.0, sin_azimuth = sin_o > 0.0 ? wo.y / sin_o : 0.0;
  std::vector<LightNode> nodes;
  nodes.reserve(u_.size() * static_cast<std::size_t>(azimuths_));
  for (int k = 0; k < azimuths_; ++k) {
    const double phi_h = 2.0 * pi * (k + 0.5) / azimuths_;
    const double x = sin_o * std::cos(phi_h);
    const double a = std::hypot(wo.z, x), delta = std::atan2(x, wo.z), theta_max = 0.5 * (0.5 * pi + delta);
    for (std::size_t j = 0; j < u_.size(); ++j) {
      const double theta_h = theta_max * u_[j] * u_[j];
      const double sin_h = std::sin(theta_h), cos_d = a * std::cos(theta_h - delta);
      // The view mirrored at the half vector.
      const double along = 2.0 * cos_d * sin_h * std::cos(phi_h) - sin_o;
      const double across = 2.0 * cos_d * sin_h * std::sin(phi_h);
      const Direction wi{cos_azimuth * along - sin_azimuth * across, sin_azimuth * along + cos_azimuth * across,
                         a * std::sin(2.0 * (theta_max - theta_h))};
      const double weight = weight_[j] * 2.0 * theta_max * u_[j] * sin_h * (2.0 * pi / azimuths_) * 4.0 * cos_d;
      nodes.push_back({wi, weight});
    }
  }
  return nodes;
}

}  // namespace lobefit
