// Unreal's Cloth: fuzz instead of gloss.
#pragma once

#include "models/unreal/default_lit.h"

namespace lobefit {

struct UnrealCloth {
  static constexpr ModelInfo info{
      .name = "unreal_cloth",
      .title = "Unreal Engine 4 Cloth",
      .source = "Unreal Engine 4, ClothBxDF (named in S4), as publicly described; S4's D and G of cloth",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "DefaultLit whose GGX lobe is blended by `cloth` into an inverted one with cloth visibility and the fuzz "
          "colour as reflectance. The pin opacity has no part in it."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    Vec3<T> fuzz_color;
    T cloth;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(p.fuzz_color, ParameterInfo{.name = "fuzz_color",
                                      .symbol = "c_f",
                                      .initial = 0.5,
                                      .doc = "Reflectance of the fibres at normal incidence, linear Rec.709 RGB."});
    visit(p.cloth,
          ParameterInfo{.name = "cloth", .symbol = "k", .initial = 1.0, .doc = "0 the gloss of DefaultLit, 1 fuzz."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T alpha = let("alpha", unreal_alpha(p.roughness));
    const T gloss_lobe = let("gloss_lobe", call<UnrealGgx>(g.sin2_theta_h, g.cos_theta_i, g.cos_theta_o, alpha));
    Vec3<T> gloss = let("gloss", unreal_fresnel(g.cos_theta_d, unreal_specular_color(p)) * gloss_lobe);
    const T fuzz_lobe = let("fuzz_lobe", call<AshikhminApproximation>(square(g.cos_theta_h), alpha) *
                                             call<ClothVisibility>(g.cos_theta_i, g.cos_theta_o));
    Vec3<T> fuzz = let("fuzz", unreal_fresnel(g.cos_theta_d, p.fuzz_color) * fuzz_lobe);
    // Not by lerp(): next to a sharp gloss of weight 0 the fuzz would drown in rounding.
    return unreal_diffuse_color(p) / pi + (gloss * (1.0 - p.cloth) + fuzz * p.cloth);
  }

  /// Fuzz is nearly flat: the cosine serves it.
  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return lobes(p, wo).sample(wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return lobes(p, wo).pdf(wi, wo);
  }

 private:
  static UnrealLobes lobes(const Parameters<double>& p, const Direction& wo) {
    UnrealSurface<double> shown = p;
    shown.base_color = p.base_color * (1.0 - p.metallic) + p.fuzz_color * (0.5 * p.cloth);
    shown.metallic = 0.0;
    return {shown, unreal_alpha(p.roughness), wo};
  }
};

}  // namespace lobefit
