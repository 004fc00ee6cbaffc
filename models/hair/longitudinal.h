// How light spreads along a fibre: M of d'Eon et al. 2011, with the Bessel function as S3's polynomials.
#pragma once

#include "models/hair/fibre.h"

namespace lobefit {

/// exp(-x) I0(x) for x ≥ 0: the two polynomials of S3's I0 (Abramowitz, Stegun 1964, 9.8.1, 9.8.2), relative error
/// below 5e-7. S3's own ln I0 for x > 12 is another: its series ends in ½/(8x) where 1/(8x) is meant, which makes I0
/// 0.57 % too low at 12 and less beyond. Ours keeps the polynomial, which needs no other form: nothing overflows.
struct ScaledBesselI0 {
  static constexpr const char* name = "scaled_bessel_i0";
  static constexpr std::array arguments{"x"};

  template <class T>
  LOBEFIT_TEXT static auto evaluate(const T& x) {
    const T small = let("small", min(x, 3.75) / 3.75);
    const T t = let("t", small * small);
    const T below = let(
        "below",
        1.0 + t * (3.5156229 + t * (3.0899424 + t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813))))));
    const T u = let("u", 3.75 / max(x, 3.75));
    const T above = let(
        "above",
        0.39894228 + u * (0.01328592 +
                          u * (0.00225319 +
                               u * (-0.00157565 +
                                    u * (0.00916281 +
                                         u * (-0.02057706 + u * (0.02635537 + u * (-0.01647633 + u * 0.00392377))))))));
    return select(x < 3.75, below * exp(-min(x, 3.75)), above / sqrt(max(x, 3.75)));
  }
};

/// M = exp(-sinθ_l sinθ_v/v) I0(cosθ_l cosθ_v/v)/(2v sinh(1/v)), v = width²; ∫ M cosθ_l dθ_l = 1. As
/// exp(-x) I0(x) exp(-(1 - cos(θ_l + θ_v))/v)/(v (1 - exp(-2/v))), x = cosθ_l cosθ_v/v, for every v.
struct HairBesselM {
  static constexpr const char* name = "hair_bessel_m";
  static constexpr std::array arguments{"width", "sin_theta_l", "cos_theta_l", "sin_theta_v", "cos_theta_v"};

  template <class W, class L, class V>
  LOBEFIT_TEXT static auto evaluate(const W& width, const L& sin_theta_l, const L& cos_theta_l, const V& sin_theta_v,
                                    const V& cos_theta_v) {
    const auto product = let("product", cos_theta_l * cos_theta_v);
    // 1 - cos(θ_l + θ_v) = 2 sin²((θ_l + θ_v)/2), and sinθ_l + sinθ_v = 2 sin((θ_l + θ_v)/2) cosθ_d.
    const auto sines2 = let("sines2", square(sin_theta_l + sin_theta_v));
    const auto rise = let("rise", 2.0 * sines2 / max(square(cos_theta_l + cos_theta_v) + sines2, smallest_base));
    const auto v = let("v", width * width);
    return call<ScaledBesselI0>(product / v) * exp(-rise / v) / (v * (1.0 - exp(-2.0 / v)));
  }
};

}  // namespace lobefit
