// Elementary functions of float that vectorise.
//
// Branch-free, so that loops over them become SIMD code with the same bits on every instruction set (build with
// -ffp-contract=off): only +, -, *, /, √, integer shifts and selects are used.
#pragma once

#include <bit>
#include <cstdint>

#include "models/scalar.h"

namespace lobefit {

/// 2^x for x in [-126, 127.5]: relative error below 2e-7.
LOBEFIT_TEXT float float_exp2_clamped(float clamped) {
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
  return p * std::bit_cast<float>((half + 127) << 23) * std::bit_cast<float>((whole - half + 127) << 23);
}

/// 2^x for x clamped to [-126, 127.5].
LOBEFIT_TEXT float float_exp2(float x) { return float_exp2_clamped(x < -126.0f ? -126.0f : (x > 127.5f ? 127.5f : x)); }

/// log2 of a positive normal number: relative error below 2.4e-7, also near 1.
LOBEFIT_TEXT float float_log2(float x) {
  const std::int32_t bits = std::bit_cast<std::int32_t>(x);
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
  return static_cast<float>(exponent) + s * p;
}

/// cos and sin of u turns, 0 ≤ u ≤ 1, by Taylor polynomials on |x| ≤ π/4: absolute error below 2e-7.
LOBEFIT_TEXT void float_cosine_and_sine_of_turns(float u, float& cosine, float& sine) {
  const std::int32_t quarter = static_cast<std::int32_t>(4.0f * u + 0.5f);
  const float x = (u - 0.25f * static_cast<float>(quarter)) * 6.2831853f;
  const float x2 = x * x;
  float s = 2.7557319e-6f;
  s = s * x2 - 1.9841270e-4f;
  s = s * x2 + 8.3333333e-3f;
  s = s * x2 - 1.6666667e-1f;
  s = x + x * x2 * s;
  float c = 2.4801587e-5f;
  c = c * x2 - 1.3888889e-3f;
  c = c * x2 + 4.1666667e-2f;
  c = c * x2 - 0.5f;
  c = 1.0f + x2 * c;
  const bool odd = (quarter & 1) != 0;
  const float a = odd ? s : c;
  const float b = odd ? c : s;
  cosine = ((quarter + 1) & 2) != 0 ? -a : a;
  sine = (quarter & 2) != 0 ? -b : b;
}

}  // namespace lobefit
