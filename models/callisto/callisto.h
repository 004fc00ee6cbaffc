// The Callisto BRDF in the slides' form: (c1 f_diffuse + f_ggx) c2.
#pragma once

#include "models/callisto/modulation.h"
#include "models/callisto/terminator.h"
#include "models/diffuse/proxima.h"
#include "models/sampling.h"
#include "models/specular/ggx.h"

namespace lobefit {

inline constexpr ParameterInfo callisto_f0_parameter{
    .name = "f0", .symbol = "f_0", .initial = 0.04, .doc = "Specular reflectance at normal incidence."};
inline constexpr ParameterInfo callisto_specular_falloff_parameter{
    .name = "specular_fresnel_falloff",
    .symbol = "n_s",
    .initial = 0.5,
    .tier = Tier::advanced,
    .doc = "Falloff of the specular Fresnel: 0 none, 1/2 Schlick, 1 full reflection at every angle."};
// The symbol table of a transcription says Base, the slides' tier table (98) Full.
inline constexpr ParameterInfo callisto_terminator_length_parameter{
    .name = "terminator_length",
    .symbol = "p",
    .initial = 0.5,
    .tier = Tier::full,
    .doc = "How far the smooth terminator reaches, in N·L."};

/// Tints of the intensities of c1.
template <class T>
struct CallistoTints {
  Vec3<T> diffuse_fresnel, retroreflection;
};

template <class P, class Visit>
constexpr void describe_callisto_tints(P& p, Visit&& visit) {
  visit(p.diffuse_fresnel, ParameterInfo{.name = "diffuse_fresnel_tint",
                                         .initial = 1.0,
                                         .tier = Tier::advanced,
                                         .doc = "Multiplies diffuse_fresnel."});
  visit(p.retroreflection, ParameterInfo{.name = "retroreflection_tint",
                                         .initial = 1.0,
                                         .tier = Tier::advanced,
                                         .doc = "Multiplies retroreflection."});
}

template <class T>
struct CallistoParameters {
  Vec3<T> albedo;
  T alpha;
  CallistoModulation<T> modulation;
  CallistoTints<T> tints;
  T terminator;
  Vec3<T> terminator_tint;
  T terminator_length;
  Vec3<T> f0;
  T specular_fresnel_falloff;
  T dual_specular_roughness_scale, dual_specular_opacity, dual_specular;
};

inline constexpr std::array<std::string_view, 2> callisto_dual_specular_choices{"mix", "add"};

template <class P, class Visit>
constexpr void describe_callisto(P& p, Visit&& visit) {
  visit(p.albedo, albedo_parameter);
  visit(p.alpha, alpha_parameter);
  describe_callisto_modulation(p.modulation, visit);
  describe_callisto_tints(p.tints, visit);
  visit(p.terminator,
        ParameterInfo{.name = "terminator",
                      .symbol = "o",
                      .lower = -1.0,
                      .initial = 0.0,
                      .doc = "Smooth terminator: darkens (or brightens, if negative) where N·L is small."});
  visit(p.terminator_tint,
        ParameterInfo{
            .name = "terminator_tint", .initial = 1.0, .tier = Tier::advanced, .doc = "Multiplies terminator."});
  visit(p.terminator_length, callisto_terminator_length_parameter);
  visit(p.f0, callisto_f0_parameter);
  visit(p.specular_fresnel_falloff, callisto_specular_falloff_parameter);
  visit(p.dual_specular_roughness_scale, ParameterInfo{.name = "dual_specular_roughness_scale",
                                                       .upper = 4.0,
                                                       .initial = 1.0,
                                                       .tier = Tier::advanced,
                                                       .doc = "Roughness of the second lobe over that of the first."});
  visit(p.dual_specular_opacity, ParameterInfo{.name = "dual_specular_opacity",
                                               .initial = 0.0,
                                               .tier = Tier::advanced,
                                               .doc = "Weight of the second lobe."});
  visit(p.dual_specular,
        ParameterInfo{.name = "dual_specular",
                      .upper = 1.0,
                      .initial = 0.0,
                      .tier = Tier::advanced,
                      .doc = "How the lobes join: mix takes from the first what the second gets, add does not.",
                      .choices = callisto_dual_specular_choices});
}

/// Alpha of the second lobe: sat(r scale)² with alpha = r².
template <class T>
LOBEFIT_TEXT T callisto_second_alpha(const CallistoParameters<T>& p) {
  return min(p.alpha * square(p.dual_specular_roughness_scale), 1.0);
}

/// c1 base + D V F, times c2; `base` is the diffuse BRDF.
///
/// The slides do not say how the two specular lobes join. Both readings share F, and one text serves both:
/// (1 - opacity [mix]) lobe + opacity second_lobe.
template <class T, class G>
LOBEFIT_TEXT Vec3<T> callisto_brdf(const CallistoParameters<T>& p, const Geometry<G>& g, const Vec3<T>& base) {
  const G one_minus_cos_theta_d = let("one_minus_cos_theta_d", one_minus_cosine(g.sin2_theta_d, g.cos_theta_d));
  const G one_minus_cos_theta_h = let("one_minus_cos_theta_h", one_minus_cosine(g.sin2_theta_h, g.cos_theta_h));
  const Vec3<T> c1 = let("c1", callisto_modulation(p.modulation, CosinePair<G>{g.cos_theta_d, one_minus_cos_theta_d},
                                                   CosinePair<G>{g.cos_theta_h, one_minus_cos_theta_h},
                                                   p.modulation.diffuse_fresnel * p.tints.diffuse_fresnel,
                                                   p.modulation.retroreflection * p.tints.retroreflection));

  const T second_lobe = let("second_lobe", ggx_lobe(callisto_second_alpha(p), g));
  const T mix = 1.0 - p.dual_specular;
  const T lobe =
      let("lobe", (1.0 - p.dual_specular_opacity * mix) * ggx_lobe(p.alpha, g) + p.dual_specular_opacity * second_lobe);
  const Vec3<T> specular_fresnel =
      let("specular_fresnel", call<CallistoFresnel>(one_minus_cos_theta_d, p.f0, p.specular_fresnel_falloff));

  const G mask = let("mask", call<CallistoTerminatorMask>(g.cos_theta_d, g.cos_theta_h));
  const T edge = let("edge", call<CallistoSmoothEdge>(mask * p.terminator_length, g.cos_theta_i));
  const Vec3<T> c2 = let("c2", 1.0 + (edge - 1.0) * mask * (p.terminator * p.terminator_tint));
  return (c1 * base + lobe * specular_fresnel) * c2;
}

/// What the slides' two forms share; `Form` has `info` and `base(p, g)`, the diffuse BRDF.
template <class Form>
struct CallistoModel {
  template <class T>
  using Parameters = CallistoParameters<T>;

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_callisto(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    return callisto_brdf(p, g, Form::base(p, g));
  }

  /// Half by the cosine, half by the facets that wo sees, of the two lobes in their shares.
  static Direction sample(const Parameters<double>& p, const Direction& wo, std::array<double, 2> u) {
    const std::size_t lobe = pick_lobe(shares(p), u);
    return lobe == 0 ? sample_cosine(u) : sample_visible_reflection(Distribution::ggx, alpha(p, lobe), wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    const std::array<double, 3> share = shares(p);
    double density = share[0] * cosine_density(wi);
    for (const std::size_t lobe : {std::size_t{1}, std::size_t{2}}) {
      density += share[lobe] * visible_reflection_density(Distribution::ggx, alpha(p, lobe), wi, wo);
    }
    return density;
  }

 private:
  static std::array<double, 3> shares(const Parameters<double>& p) {
    return {0.5, 0.5 * (1.0 - p.dual_specular_opacity), 0.5 * p.dual_specular_opacity};
  }
  static Alpha alpha(const Parameters<double>& p, std::size_t lobe) {
    return max(lobe == 1 ? p.alpha : callisto_second_alpha(p), smallest_alpha);
  }
};

struct Callisto : CallistoModel<Callisto> {
  static constexpr ModelInfo info{
      .name = "callisto",
      .title = "Callisto: modulated Proxima + GGX",
      .source = "Jimenez et al. 2023, The Character Rendering Art of The Callisto Protocol, slides 67-98, 131",
      .reciprocal = false,
      .energy_conserving = false,
      .doc =
          "Diffuse Fresnel and retroreflection (c1, in theta_d and theta_h) on Proxima, GGX with a Fresnel falloff, "
          "and a smooth terminator (c2) on both."};

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> base(const CallistoParameters<T>& p, const Geometry<G>& g) {
    return let("proxima", p.albedo / pi * published_proxima_factor(p.alpha, g));
  }
};

struct CallistoLambert : CallistoModel<CallistoLambert> {
  static constexpr ModelInfo info{
      .name = "callisto_lambert",
      .title = "Callisto: modulated Lambert + GGX",
      .source = "Jimenez et al. 2023, The Character Rendering Art of The Callisto Protocol, slides 67-98",
      .reciprocal = false,
      .energy_conserving = false,
      .doc = "As callisto, on Lambert. Reciprocal while terminator is 0."};

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> base(const CallistoParameters<T>& p, const Geometry<G>&) {
    return p.albedo / pi;
  }
};

}  // namespace lobefit
