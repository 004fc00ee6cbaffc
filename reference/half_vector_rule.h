// Quadrature over the directions to the light for one viewer, in coordinates of the half vector, where lobes lie still.
//
// With the view at polar angle theta_o and azimuth 0, the half vector at (theta_h, phi_h), and
// A e^(iδ) = cos theta_o + i sin theta_o cos phi_h,
//
//   V·H = A cos(theta_h - δ),   N·L = A sin 2(theta_max - theta_h),   dω_i = 4 (V·H) sin theta_h dtheta_h dphi_h,
//
// so that at each azimuth the light's hemisphere is 0 ≤ theta_h ≤ theta_max = (π/2 + δ)/2: the horizon is an end of the
// interval, no kink in it. theta_h = theta_max u² with Gauss-Legendre nodes in u crowds them about the normal, where
// narrow lobes are; azimuths are equal steps.
#pragma once

#include <vector>

#include "models/geometry.h"

namespace lobefit {

struct LightNode {
  Direction wi;   // above the surface
  double weight;  // solid angle: ∫ g dω_i ≈ Σ weight g(wi)
};

class HalfVectorRule {
 public:
  /// 16 n × 32 n nodes. At n = 1 albedos are exact to 1e-6 for a Lambertian surface, to 4e-4 for a GGX lobe of
  /// alpha = 0.05 and to 1e-2 at 0.01; at n = 2 to 1e-5 even there.
  explicit HalfVectorRule(int n);

  /// Nodes for a viewer at wo, above the surface.
  std::vector<LightNode> lights(const Direction& wo) const;

 private:
  std::vector<double> u_, weight_;
  int azimuths_;
};

}  // namespace lobefit
