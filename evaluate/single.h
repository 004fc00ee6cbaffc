// Single: a float that never promotes, and transcendental functions that vectorise.
//
// Literals in texts are doubles; an operation with a Single rounds them to float first, as a shader compiler would.
// exp2, log2 and pow are branch-free, so that loops over texts become SIMD code with the same bits on every
// instruction set (build with -ffp-contract=off): only +, -, *, /, √, integer shifts and selects are used.
#pragma once

#include <bit>
#include <cstdint>

#include "models/arc_cosine.h"
#include "models/scalar.h"

namespace lobefit {

class Single {
 public:
  float value = 0.0f;

  Single() = default;
  LOBEFIT_TEXT constexpr Single(double x) : value(static_cast<float>(x)) {}
  LOBEFIT_TEXT constexpr explicit Single(float x) : value(x) {}

  LOBEFIT_TEXT friend constexpr Single operator+(Single a, Single b) { return Single(a.value + b.value); }
  LOBEFIT_TEXT friend constexpr Single operator-(Single a, Single b) { return Single(a.value - b.value); }
  LOBEFIT_TEXT friend constexpr Single operator*(Single a, Single b) { return Single(a.value * b.value); }
  LOBEFIT_TEXT friend constexpr Single operator/(Single a, Single b) { return Single(a.value / b.value); }
  LOBEFIT_TEXT friend constexpr Single operator-(Single a) { return Single(-a.value); }
  LOBEFIT_TEXT friend constexpr bool operator<(Single a, Single b) { return a.value < b.value; }
  LOBEFIT_TEXT friend constexpr bool operator>(Single a, Single b) { return a.value > b.value; }
  LOBEFIT_TEXT friend constexpr bool operator<=(Single a, Single b) { return a.value <= b.value; }
  LOBEFIT_TEXT friend constexpr bool operator>=(Single a, Single b) { return a.value >= b.value; }

  /// By masks, not ?:, which would become a branch: where the condition depends on parameters alone, GCC 12 moves it
  /// out of the loop and then can't vectorise what is left.
  LOBEFIT_TEXT friend constexpr Single select(bool condition, Single a, Single b) {
    const std::uint32_t mask = -static_cast<std::uint32_t>(condition);
    return Single(std::bit_cast<float>((std::bit_cast<std::uint32_t>(a.value) & mask) |
                                       (std::bit_cast<std::uint32_t>(b.value) & ~mask)));
  }
  LOBEFIT_TEXT friend constexpr Single min(Single a, Single b) { return select(a < b, a, b); }
  LOBEFIT_TEXT friend constexpr Single max(Single a, Single b) { return select(a > b, a, b); }
  LOBEFIT_TEXT friend constexpr Single abs(Single x) {
    return Single(std::bit_cast<float>(std::bit_cast<std::uint32_t>(x.value) & 0x7fffffffu));
  }
  LOBEFIT_TEXT friend Single sqrt(Single x) { return Single(__builtin_sqrtf(max(x, 0.0).value)); }

  /// 2^x for x clamped to [-126, 127.5]: relative error below 2e-7.
  LOBEFIT_TEXT friend Single exp2(Single x) {
    const float clamped = x.value < -126.0f ? -126.0f : (x.value > 127.5f ? 127.5f : x.value);
    // Round to nearest by truncating a positive number: every instruction set has that conversion.
    const std::int32_t whole = static_cast<std::int32_t>(clamped + 128.5f) - 128;
    const float f = clamped - static_cast<float>(whole);
    // Taylor coefficients lnⁿ2/n!; |f| ≤ ½ leaves a remainder below 6e-9.
    float p = 1.5252734e-5f;
    p = p * f + 1.5403530e-4f;
    p = p * f + 1.3333558e-3f;
    p = p * f + 9.6181291e-3f;
    p = p * f + 5.5504109e-2f;
    p = p * f + 2.4022651e-1f;
    p = p * f + 6.9314718e-1f;
    p = p * f + 1.0f;
    // Two factors keep 2^whole a normal number up to 128.
    const std::int32_t half = whole >> 1;
    return Single(p * std::bit_cast<float>((half + 127) << 23) * std::bit_cast<float>((whole - half + 127) << 23));
  }

  /// log2 of max(x, smallest_base): relative error below 2.4e-7, also near 1.
  LOBEFIT_TEXT friend Single log2(Single x) {
    const std::int32_t bits = std::bit_cast<std::int32_t>(max(x, smallest_base).value);
    // m in [√½, √2) and its exponent, by an offset that carries at √2.
    const std::int32_t exponent = (bits - 0x3f3504f3) >> 23;
    const float m = std::bit_cast<float>(bits - (exponent << 23));
    // log2 m = (2/ln 2) artanh s, s = (m-1)/(m+1), |s| ≤ 0.172.
    const float s = (m - 1.0f) / (m + 1.0f);
    const float s2 = s * s;
    float p = 0.32059890f;
    p = p * s2 + 0.41219859f;
    p = p * s2 + 0.57707802f;
    p = p * s2 + 0.96179669f;
    p = p * s2 + 2.88539008f;
    return Single(static_cast<float>(exponent) + s * p);
  }

  LOBEFIT_TEXT friend Single log(Single x) { return log2(x) * std::numbers::ln2; }
  LOBEFIT_TEXT friend Single exp(Single x) { return exp2(x * std::numbers::log2e); }
  LOBEFIT_TEXT friend Single pow(Single x, Single y) { return exp2(y * log2(x)); }
  LOBEFIT_TEXT friend Single acos(Single x) { return ArcCosine::evaluate(x); }
};

}  // namespace lobefit
