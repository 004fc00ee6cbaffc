// The Callisto BRDF as a public port to Unreal Engine 4.27 has it (S0).
#pragma once

#include "models/callisto/callisto.h"

namespace lobefit {

/// Where the port differs from the slides:
///   - c1 takes N·L and N·V in the place of the cosines of θ_d and θ_h: its "Fresnel" grows where the light grazes
///     whatever the view, and it is reciprocal only if both triples are equal;
///   - c2's mask takes N·V in the place of N·H; o is gone, and its edge ends at .001;
///   - the tints of c1 are 1, that of the terminator .5, the tangent falloffs .75, all hard-coded. Here they are
///     parameters with those defaults.
struct CallistoUe427 {
  static constexpr ModelInfo info{
      .name = "callisto_ue427",
      .title = "Callisto as ported to Unreal Engine 4.27",
      .source = "Callisto BRDF, UE4.27 Vite fork port attempt, v1.1 (S0), after Jimenez et al. 2023",
      .reciprocal = false,
      .energy_conserving = false,
      .doc =
          "Callisto with N·L and N·V in the place of the slides' angles, a terminator that is always on, and Proxima."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T roughness;
    CallistoModulation<T> modulation;
    CallistoTints<T> tints;
    Vec3<T> terminator_tint;
    T terminator_length;
    Vec3<T> f0;
    T specular_fresnel_falloff;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.roughness, roughness_parameter);
    describe_callisto_modulation(p.modulation, visit);
    describe_callisto_tints(p.tints, visit);
    visit(p.terminator_tint, ParameterInfo{.name = "terminator_tint",
                                           .initial = 0.5,
                                           .tier = Tier::full,
                                           .doc = "Weight of the smooth terminator; 0 switches it off."});
    visit(p.terminator_length, callisto_terminator_length_parameter);
    visit(p.f0, callisto_f0_parameter);
    visit(p.specular_fresnel_falloff, callisto_specular_falloff_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T alpha = let("alpha", p.roughness * p.roughness);
    const G one_minus_cos_theta_i =
        let("one_minus_cos_theta_i", one_minus_cosine(square(g.sin_theta_i), g.cos_theta_i));
    const G one_minus_cos_theta_o =
        let("one_minus_cos_theta_o", one_minus_cosine(square(g.sin_theta_o), g.cos_theta_o));
    const Vec3<T> c1 = let("c1", callisto_modulation(p.modulation, CosinePair<G>{g.cos_theta_i, one_minus_cos_theta_i},
                                                     CosinePair<G>{g.cos_theta_o, one_minus_cos_theta_o},
                                                     p.modulation.diffuse_fresnel * p.tints.diffuse_fresnel,
                                                     p.modulation.retroreflection * p.tints.retroreflection));
    const Vec3<T> proxima = let("proxima", p.albedo / pi * published_proxima_factor(alpha, g));

    // The port keeps the base of its power above 1e-4.
    const G one_minus_cos_theta_d =
        let("one_minus_cos_theta_d", max(one_minus_cosine(g.sin2_theta_d, g.cos_theta_d), 1e-4));
    const Vec3<T> specular_fresnel =
        let("specular_fresnel", call<CallistoFresnel>(one_minus_cos_theta_d, p.f0, p.specular_fresnel_falloff));

    const G mask = let("mask", call<CallistoTerminatorMask>(g.cos_theta_d, g.cos_theta_o));
    const T edge = let("edge", call<CallistoSmoothEdge>(max(mask * p.terminator_length, 1e-3), g.cos_theta_i));
    const Vec3<T> c2 = let("c2", 1.0 + (edge - 1.0) * mask * p.terminator_tint);
    return (c1 * proxima + ggx_lobe(alpha, g) * specular_fresnel) * c2;
  }

  /// Half by the cosine, half by the facets that wo sees.
  static Direction sample(const Parameters<double>& p, const Direction& wo, std::array<double, 2> u) {
    return pick_lobe(std::array{0.5, 0.5}, u) == 0 ? sample_cosine(u)
                                                   : sample_visible_reflection(Distribution::ggx, alpha(p), wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return 0.5 * cosine_density(wi) + 0.5 * visible_reflection_density(Distribution::ggx, alpha(p), wi, wo);
  }

 private:
  static Alpha alpha(const Parameters<double>& p) { return max(square(p.roughness), smallest_alpha); }
};

}  // namespace lobefit
