#pragma once
#include "models/scalar.h"
namespace lobefit {
template <class T>
LOBEFIT_TEXT T single_scattering_albedo(const T& diffuse_albedo, const T& g) {
  const T s = let(
      "s", 4.09712 + 4.20863 * diffuse_albedo - sqrt(9.59217 + diffuse_albedo * (41.6808 + 17.7126 * diffuse_albedo)));
  return saturate((1.0 - s * s) / (1.0 - g * s * s));
}
template <class T>
LOBEFIT_TEXT Vec3<T> single_scattering_albedo(const Vec3<T>& r, const T& g) {
  return {single_scattering_albedo(r.x, g), single_scattering_albedo(r.y, g), single_scattering_albedo(r.z, g)};
}
}  // namespace lobefit
