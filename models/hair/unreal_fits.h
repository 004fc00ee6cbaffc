// Unreal's fits to what its hair approximates (S3), with their constants as arguments: the one text of the model, of
// the terms and of the forms that refits move. The scalars' types may differ.
#pragma once

#include "models/hair/fibre.h"

namespace lobefit {

/// η' ≈ c1/cosθ_d + c2 cosθ_d of Bravais's index.
template <class K, class T>
LOBEFIT_TEXT auto hair_index_fit(const K& c1, const K& c2, const T& cos_theta_d) {
  return c1 / cos_theta_d + c2 * cos_theta_d;
}
/// 1/η' of the same.
template <class K, class T>
LOBEFIT_TEXT auto hair_inverse_index_fit(const K& c1, const K& c2, const T& cos_theta_d) {
  return cos_theta_d / (c1 + c2 * cos_theta_d * cos_theta_d);
}

/// h_TT ≈ cos(φ/2) (1 + (h_0 - h_1 cosφ)/η').
template <class K, class T, class G>
LOBEFIT_TEXT auto hair_tt_offset_fit(const K& h0, const K& h1, const T& inverse_index, const G& cos_phi,
                                     const G& cos_half_phi) {
  return cos_half_phi * (1.0 + inverse_index * (h0 - h1 * cos_phi));
}

/// exp(d1 cosφ - d0) for an azimuthal lobe.
template <class K, class T>
LOBEFIT_TEXT auto hair_azimuth_fit(const K& d1, const K& d0, const T& cos_phi) {
  return exp(d1 * cos_phi - d0);
}

/// Exponent of the colour on the way of TT: θ_d stands where θ_t is meant.
template <class K, class T, class G>
LOBEFIT_TEXT auto hair_tt_exponent_fit(const K& t, const T& cos_gamma_t, const G& cos_theta_d) {
  return t * cos_gamma_t / cos_theta_d;
}
/// On the way of TRT.
template <class K, class G>
LOBEFIT_TEXT auto hair_trt_exponent_fit(const K& t, const G& cos_theta_d) {
  return t / cos_theta_d;
}

/// TT's way where absorption comes by Chiang's map, as the code has it: a bracket closes too late.
template <class T, class G>
LOBEFIT_TEXT auto hair_tt_chord_as_coded(const T& sin2_gamma_t, const G& cos_theta_d) {
  return abs(1.0 - sin2_gamma_t / cos_theta_d);
}
/// With the bracket closed.
template <class T, class G>
LOBEFIT_TEXT auto hair_tt_chord(const T& sin2_gamma_t, const G& cos_theta_d) {
  return max(1.0 - sin2_gamma_t, 0.0) / cos_theta_d;
}

/// (1 - F)² F of TRT at one offset h = √(1 - g²).
template <class K, class G, class F>
LOBEFIT_TEXT auto hair_trt_fresnel_fit(const K& g, const G& cos_theta_d, const F& f0) {
  const auto cosine = cos_theta_d * g;
  const auto f_trt = let("f_trt", call<HairSchlick>(cosine, f0));
  const auto enters_trt = let("enters_trt", call<SchlickTransmittance>(cosine, f0));
  return square(enters_trt) * f_trt;
}

}  // namespace lobefit
