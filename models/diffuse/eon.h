// EON: the energy-preserving Oren-Nayar model.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

/// Directional albedo of Fujii's single-scattering lobe at ρ = 1, exact form.
struct EonAlbedo {
  static constexpr const char* name = "eon_albedo";
  static constexpr std::array arguments{"cos_theta", "sin_theta", "roughness", "a_f"};

  template <class C, class S, class R, class A>
  LOBEFIT_TEXT static auto evaluate(const C& cos_theta, const S& sin_theta, const R& roughness, const A& a_f) {
    // G = S (θ - S μ) + ⅔ ((S/μ)(1 - S³) - S). With 1 - S = μ²/(1 + S) the quotient loses its cancellation and its
    // pole at grazing angles.
    const auto quotient = sin_theta * cos_theta * (1.0 + sin_theta + sin_theta * sin_theta) / (1.0 + sin_theta);
    const auto g =
        let("g", sin_theta * (acos(cos_theta) - sin_theta * cos_theta) + (2.0 / 3.0) * (quotient - sin_theta));
    return a_f * (1.0 + roughness * g / pi);
  }
};

struct Eon : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "eon",
      .title = "EON diffuse (energy-preserving Oren-Nayar)",
      .source = "Portsmouth, Kutz, Hill 2024, EON: A Practical Energy-Preserving Rough Diffuse BRDF",
      .reciprocal = true,
      .energy_conserving = true,
      .doc = "Fujii's improved Oren-Nayar lobe plus the lobe that returns the energy it loses."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T roughness;
    T multiple_scattering;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(
        p.roughness,
        ParameterInfo{.name = "roughness",
                      .symbol = "r",
                      .initial = 0.5,
                      .doc = "EON's own roughness, linear in Oren-Nayar's sigma; 0.4 sqrt(alpha) is near GGX facets."});
    visit(p.multiple_scattering, multiple_scattering_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    constexpr double k1 = 0.5 - 2.0 / (3.0 * pi);
    constexpr double k2 = 2.0 / 3.0 - 28.0 / (15.0 * pi);
    const G s = let("s", g.tangential_dot);
    const G s_over_t = let("s_over_t", select(s > 0.0, s / max(max(g.cos_theta_i, g.cos_theta_o), smallest_base), s));
    const T a_f = let("a_f", 1.0 / (1.0 + k1 * p.roughness));
    const T single = let("single", a_f * (1.0 + p.roughness * s_over_t));

    const T albedo_i = let("albedo_i", call<EonAlbedo>(g.cos_theta_i, g.sin_theta_i, p.roughness, a_f));
    const T albedo_o = let("albedo_o", call<EonAlbedo>(g.cos_theta_o, g.sin_theta_o, p.roughness, a_f));
    const T average = let("average", a_f * (1.0 + k2 * p.roughness));
    // (1 - E_i)(1 - E_o)/(1 - E_avg) is 0/0 on a smooth surface, where it has to vanish.
    const T lost = let("lost", (1.0 - albedo_i) * (1.0 - albedo_o) / max(1.0 - average, 1e-7));
    const Vec3<T> multiple = let("multiple", p.albedo * average / (1.0 - p.albedo * (1.0 - average)));
    return p.albedo / pi * (single + multiple * (p.multiple_scattering * lost));
  }
};

}  // namespace lobefit
