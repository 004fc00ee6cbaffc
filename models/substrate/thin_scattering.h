#pragma once
#include "models/geometry.h"
namespace lobefit {
template <class T, class G>
LOBEFIT_TEXT Vec3<T> thin_scattering(const Vec3<T>& omega, const Vec3<T>& depth, const T&, const Geometry<G>& g) {
  const G inverse = 1.0 / max(g.cos_theta_i, 1e-6) + 1.0 / max(g.cos_theta_o, 1e-6);
  const Vec3<T> e{T(exp(-(depth.x * inverse))), T(exp(-(depth.y * inverse))), T(exp(-(depth.z * inverse)))};
  return omega * (1.0 - e) / (4.0 * pi * max(g.cos_theta_i + g.cos_theta_o, 1e-6));
}
}  // namespace lobefit
