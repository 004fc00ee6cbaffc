// Oren-Nayar's qualitative model, and Fujii's repair of it.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

inline constexpr ParameterInfo sigma_parameter{.name = "sigma",
                                               .symbol = "σ",
                                               .unit = "rad",
                                               .upper = pi / 2.0,
                                               .initial = 0.3,
                                               .doc = "Standard deviation of the facets' slope angles."};

struct OrenNayarQualitative : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "oren_nayar_qualitative",
      .title = "Oren-Nayar diffuse, qualitative form",
      .source = "Oren, Nayar 1994, Generalization of Lambert's Reflectance Model, section 4.4",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "The full form without its third coefficient and its second bounce: flat where light and view are more "
          "than 90 degrees of azimuth apart. The albedo reaches 1.015 at the horizon (sigma 0.2)."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T sigma;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.sigma, sigma_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T s2 = let("s2", p.sigma * p.sigma);
    // The paper adds that .57 in place of .33 makes up for some of the missing second bounce.
    const T a = let("a", 1.0 - 0.5 * s2 / (s2 + 0.33));
    const T b = let("b", 0.45 * s2 / (s2 + 0.09));
    // With α = max(θi, θo), β = min(θi, θo): cos φ sin α tan β = cos φ sin θi sin θo / max(cos θi, cos θo).
    const G lobe = let("lobe", max(g.tangential_dot, 0.0) / max(max(g.cos_theta_i, g.cos_theta_o), smallest_base));
    return p.albedo / pi * (a + b * lobe);
  }
};

struct FujiiOrenNayar : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "fujii_oren_nayar",
      .title = "Fujii's improved Oren-Nayar diffuse",
      .source = "Fujii 2012, A tiny improvement of Oren-Nayar reflectance model (web page, proposed form)",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "Oren-Nayar's qualitative form with a lobe that goes on below 0 where light and view face each other, "
          "which takes away the dark ring around a lit sphere, and with a second bounce. As Fujii says, it gains "
          "energy where the albedo is above 0.97: up to 1.027 at the horizon (sigma 0.26)."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T sigma;
    T multiple_scattering;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.sigma, sigma_parameter);
    visit(p.multiple_scattering, multiple_scattering_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T s2 = let("s2", p.sigma * p.sigma);
    const T a = let("a", 1.0 - 0.5 * s2 / (s2 + 0.33));
    const T twice = let("twice", p.multiple_scattering * (0.17 * s2 / (s2 + 0.13)));
    const T b = let("b", 0.45 * s2 / (s2 + 0.09));
    const G s = let("s", g.tangential_dot);
    const G s_over_t = let("s_over_t", select(s > 0.0, s / max(max(g.cos_theta_i, g.cos_theta_o), smallest_base), s));
    const T single = let("single", a + b * s_over_t);
    return p.albedo / pi * (single + p.albedo * twice);
  }
};

}  // namespace lobefit
