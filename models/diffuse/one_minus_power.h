// 1 - (1 - x)^e without cancellation.
#pragma once

#include "models/scalar.h"

namespace lobefit {

/// 1 - (1 - x)^e for x in [0, 1] and e > 0, to a few ulp of itself: where it is small it is the binomial series
/// e x [1 - (e - 1)/2 x [1 - (e - 2)/3 x [1 - …]]], because pow() there leaves only the rounding of 1.
struct OneMinusPower {
  static constexpr const char* name = "one_minus_power";
  static constexpr std::array arguments{"x", "exponent"};

  template <class X, class E>
  LOBEFIT_TEXT static auto evaluate(const X& x, const E& exponent) {
    using T = decltype(x * exponent);
    // Up to here nine levels are exact to 1e-15, and beyond pow() is good to 5e-6 in float.
    const auto near_zero = max(exponent, 1.0) * x < 0.03;
    T series = T(1.0);
    for (int k = 9; k >= 1; --k) series = 1.0 + (static_cast<double>(k) - exponent) * (1.0 / (k + 1)) * x * series;
    return select(near_zero, exponent * x * series, 1.0 - pow(1.0 - x, exponent));
  }
};

}  // namespace lobefit
