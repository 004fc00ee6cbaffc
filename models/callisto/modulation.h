// Callisto's c1: what diffuse Fresnel and retroreflection make of a diffuse lobe.
#pragma once

#include "models/model.h"

namespace lobefit {

/// h(θ, n, φ, m) = (1 - cos⁺θ)^(5n) (cos⁺φ)^(5m) with n, m already remapped by r(x) = 2 (1 - x), as an exponent of 10
/// (1 - x). Source: Jimenez et al. 2023, The Character Rendering Art of The Callisto Protocol, slides 67-98.
///
/// Takes 1 - cos θ as it is: exponents below 1 make much of its rounding.
struct CallistoFalloff {
  static constexpr const char* name = "callisto_falloff";
  static constexpr std::array arguments{"one_minus_cos_theta", "falloff", "cos_phi", "tangent_falloff"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& one_minus_cos_theta, const T& falloff, const G& cos_phi,
                                    const T& tangent_falloff) {
    return pow(saturate(one_minus_cos_theta), 10.0 * (1.0 - falloff)) *
           pow(saturate(cos_phi), 10.0 * (1.0 - tangent_falloff));
  }
};

/// Intensities and falloffs of c1; tints multiply the intensities where a model has them.
template <class T>
struct CallistoModulation {
  T diffuse_fresnel, diffuse_fresnel_falloff, diffuse_fresnel_tangent_falloff;
  T retroreflection, retroreflection_falloff, retroreflection_tangent_falloff;
};

template <class P, class Visit>
constexpr void describe_callisto_modulation(P& p, Visit&& visit) {
  constexpr double most = 256.0;
  visit(p.diffuse_fresnel, ParameterInfo{.name = "diffuse_fresnel",
                                         .symbol = "ρ_f",
                                         .upper = most,
                                         .initial = 1.0,
                                         .doc = "Callisto's factor where light and view graze from opposite sides."});
  visit(p.diffuse_fresnel_falloff, ParameterInfo{.name = "diffuse_fresnel_falloff",
                                                 .symbol = "n_f",
                                                 .initial = 0.75,
                                                 .doc = "How far diffuse Fresnel reaches in theta_d."});
  visit(p.diffuse_fresnel_tangent_falloff, ParameterInfo{.name = "diffuse_fresnel_tangent_falloff",
                                                         .symbol = "m_f",
                                                         .initial = 0.75,
                                                         .tier = Tier::full,
                                                         .doc = "How far diffuse Fresnel reaches in theta_h."});
  visit(p.retroreflection,
        ParameterInfo{.name = "retroreflection",
                      .symbol = "ρ_r",
                      .upper = most,
                      .initial = 1.0,
                      .doc = "Callisto's factor where grazing light returns to where it came from."});
  visit(p.retroreflection_falloff, ParameterInfo{.name = "retroreflection_falloff",
                                                 .symbol = "n_r",
                                                 .initial = 0.75,
                                                 .doc = "How far retroreflection reaches in theta_h."});
  visit(p.retroreflection_tangent_falloff, ParameterInfo{.name = "retroreflection_tangent_falloff",
                                                         .symbol = "m_r",
                                                         .initial = 0.75,
                                                         .tier = Tier::full,
                                                         .doc = "How far retroreflection reaches in theta_d."});
}

/// A cosine, and 1 less it.
template <class G>
struct CosinePair {
  G cosine, one_minus_cosine;
};

/// c1 = lerp(1, ρ_f, α_f) lerp(1, ρ_r, α_r), α_f = h(d, h), α_r = h(h, d). The slides' angles d and h are θ_d and θ_h.
/// ρ_f and ρ_r are `fresnel_color` and `retro_color`, intensities or intensities times tints.
template <class T, class G, class Color>
LOBEFIT_TEXT auto callisto_modulation(const CallistoModulation<T>& p, const CosinePair<G>& d, const CosinePair<G>& h,
                                      const Color& fresnel_color, const Color& retro_color) {
  const auto fresnel = let("fresnel", call<CallistoFalloff>(d.one_minus_cosine, p.diffuse_fresnel_falloff, h.cosine,
                                                            p.diffuse_fresnel_tangent_falloff));
  const auto retro = let("retro", call<CallistoFalloff>(h.one_minus_cosine, p.retroreflection_falloff, d.cosine,
                                                        p.retroreflection_tangent_falloff));
  return (1.0 + (fresnel_color - 1.0) * fresnel) * (1.0 + (retro_color - 1.0) * retro);
}
template <class T, class G>
LOBEFIT_TEXT auto callisto_modulation(const CallistoModulation<T>& p, const G& cos_theta_d, const G& cos_theta_h) {
  return callisto_modulation(p, CosinePair<G>{cos_theta_d, 1.0 - cos_theta_d},
                             CosinePair<G>{cos_theta_h, 1.0 - cos_theta_h}, p.diffuse_fresnel, p.retroreflection);
}

}  // namespace lobefit
