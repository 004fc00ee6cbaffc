// Single: a float that never promotes, and transcendental functions that vectorise.
//
// Literals in texts are doubles; an operation with a Single rounds them to float first, as a shader compiler would.
// Its exp2, log2 and pow are branch-free (models/float_functions.h), so that loops over texts become SIMD code.
#pragma once

#include <bit>
#include <cstdint>

#include "models/arc_cosine.h"
#include "models/float_functions.h"
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
  /// Both for x ≥ 0.
  LOBEFIT_TEXT friend Single floor(Single x) { return Single(static_cast<float>(to_index(x))); }
  LOBEFIT_TEXT friend std::int32_t to_index(Single x) { return static_cast<std::int32_t>(x.value); }
  LOBEFIT_TEXT friend Single sqrt(Single x) { return Single(__builtin_sqrtf(max(x, 0.0).value)); }

  /// The clamp by masks: see select().
  LOBEFIT_TEXT friend Single exp2(Single x) {
    const Single clamped = select(x < -126.0, -126.0, select(x > 127.5, 127.5, x));
    return Single(float_exp2_clamped(clamped.value));
  }
  LOBEFIT_TEXT friend Single log2(Single x) { return Single(float_log2(max(x, smallest_base).value)); }
  LOBEFIT_TEXT friend Single log(Single x) { return log2(x) * std::numbers::ln2; }
  LOBEFIT_TEXT friend Single exp(Single x) { return exp2(x * std::numbers::log2e); }
  LOBEFIT_TEXT friend Single pow(Single x, Single y) { return exp2(y * log2(x)); }
  LOBEFIT_TEXT friend Single acos(Single x) { return ArcCosine::evaluate(x); }
};

}  // namespace lobefit
