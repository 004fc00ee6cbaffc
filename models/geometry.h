// The angles of a pair of directions, computed once for every model.
//
// Conventions: wi points to the light, wo to the viewer, both unit, away from the surface; z is the normal.
// h = normalise(wi + wo); theta_h is the angle of h with the normal, theta_d that of h with either direction
// (Rusinkiewicz 1998). The azimuth difference phi = phi_o - phi_i is 0 on the retro side, 180° on the mirror side.
#pragma once

#include "models/scalar.h"

namespace lobefit {

template <class G>
struct Geometry {
  Vec3<G> wi, wo, h;
  G cos_theta_i, cos_theta_o;  // N·L, N·V
  G sin_theta_i, sin_theta_o;
  G cos_theta_h;     // N·H
  G sin2_theta_h;    // 1 - (N·H)², from the tangential components: sharp lobes need it where N·H rounds to 1
  G cos_theta_d;     // L·H = V·H = |wi + wo|/2: no cancellation where light and view graze from opposite sides
  G sin2_theta_d;    // 1 - (L·H)² = |wi - wo|²/4: small differences from 1 survive in float
  G cos_light_view;  // L·V = -cos theta_k
  G tangential_dot;  // L·V - (N·L)(N·V), from the tangential components: no cancellation near the normal
};

template <class G>
LOBEFIT_TEXT Geometry<G> make_geometry(const Vec3<G>& wi, const Vec3<G>& wo) {
  // Not const: GCC 12 leaves a const object that an inlined function fills in memory, where no loop vectorises.
  Vec3<G> sum = let("sum", wi + wo);
  Vec3<G> difference = let("difference", wi - wo);
  Vec3<G> h = let("h", normalize(sum));
  return {.wi = wi,
          .wo = wo,
          .h = h,
          .cos_theta_i = let("cos_theta_i", wi.z),
          .cos_theta_o = let("cos_theta_o", wo.z),
          .sin_theta_i = let("sin_theta_i", sqrt(wi.x * wi.x + wi.y * wi.y)),
          .sin_theta_o = let("sin_theta_o", sqrt(wo.x * wo.x + wo.y * wo.y)),
          .cos_theta_h = let("cos_theta_h", h.z),
          .sin2_theta_h = let("sin2_theta_h", h.x * h.x + h.y * h.y),
          .cos_theta_d = let("cos_theta_d", 0.5 * sqrt(dot(sum, sum))),
          .sin2_theta_d = let("sin2_theta_d", 0.25 * dot(difference, difference)),
          .cos_light_view = let("cos_light_view", dot(wi, wo)),
          .tangential_dot = let("tangential_dot", wi.x * wo.x + wi.y * wo.y)};
}

/// 1 - cos θ without its cancellation next to θ = 0, which falloffs with exponents below 1 would blow up in float.
template <class G>
LOBEFIT_TEXT G one_minus_cosine(const G& sin2, const G& cosine) {
  return sin2 / (1.0 + cosine);
}

/// Unit direction at polar angle theta and azimuth phi, both in radians.
inline Direction direction(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

inline constexpr double radians(double degrees) { return degrees * (pi / 180.0); }
inline constexpr double degrees(double radians) { return radians * (180.0 / pi); }

}  // namespace lobefit
