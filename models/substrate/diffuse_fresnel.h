// What a smooth interface reflects of diffuse light.
#pragma once

#include "models/scalar.h"

namespace lobefit {

/// Of diffuse light from the side of the lower index, n > 1 being the ratio of the indices (Walsh 1926, as in Egan,
/// Hilgeman 1973). .0918 at 1.5. Next to n = 1 the terms cancel: below 1.01 a parabola through 0 and the value there.
struct DiffuseFresnelOutside {
  static constexpr const char* name = "diffuse_fresnel_outside";
  static constexpr std::array arguments{"index"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& index) {
    const T n = let("n", max(index, 1.01));
    const T n2 = let("n2", n * n), n4 = let("n4", n2 * n2);
    const T value =
        let("value", 0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * square(n + 1.0)) +
                         n2 * square(n2 - 1.0) / (square(n2 + 1.0) * (n2 + 1.0)) * log((n - 1.0) / (n + 1.0)) -
                         2.0 * n * n2 * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0)) +
                         8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * square(n4 - 1.0)) * log(n));
    return value * select(index < 1.01, square((max(index, 1.0) - 1.0) / 0.01), T(1.0));
  }
};
template <class T>
LOBEFIT_TEXT T diffuse_fresnel_outside(const T& index) {
  return call<DiffuseFresnelOutside>(index);
}

/// From the side of the higher index, total reflection included: 1 - (1 - F_e)/n².
template <class T>
LOBEFIT_TEXT T diffuse_fresnel_inside(const T& index) {
  const T n = max(index, 1.0);
  return 1.0 - (1.0 - diffuse_fresnel_outside(n)) / (n * n);
}

}  // namespace lobefit
