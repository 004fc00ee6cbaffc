// arccos for scalars whose hardware has none worth using: shader compilers' own is good to 1e-3…1e-4 only.
#pragma once

#include "models/scalar.h"

namespace lobefit {

/// √(1-|x|) times a polynomial, reflected for x < 0; absolute error below 2.2e-8 (Abramowitz, Stegun 1964, 4.4.46).
struct ArcCosine {
  static constexpr const char* name = "acos";
  static constexpr std::array arguments{"x"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& x) {
    const T a = let("a", min(abs(x), 1.0));
    const T low = let("low", 1.5707963050 + a * (-0.2145988016 + a * (0.0889789874 + a * -0.0501743046)));
    const T high = let("high", 0.0308918810 + a * (-0.0170881256 + a * (0.0066700901 + a * -0.0012624911)));
    const T a2 = let("a2", a * a);
    const T angle = let("angle", sqrt(1.0 - a) * (low + a2 * a2 * high));
    return select(x < 0.0, pi - angle, angle);
  }
};

}  // namespace lobefit
