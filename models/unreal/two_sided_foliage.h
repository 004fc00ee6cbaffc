// Unreal's TwoSidedFoliage: a leaf with light behind it.
#pragma once

#include "models/unreal/subsurface.h"

namespace lobefit {

struct UnrealTwoSidedFoliage {
  static constexpr ModelInfo info{
      .name = "unreal_two_sided_foliage",
      .title = "Unreal Engine 4 TwoSidedFoliage",
      .source = "Unreal Engine 4, TwoSidedBxDF (named in S4), as publicly described; McAuley 2011, wrapped diffuse",
      .reciprocal = false,
      .energy_conserving = false,
      .transmits = true,
      .doc =
          "DefaultLit plus subsurface_color times wrapped light on the far side and a GGX-shaped lobe (alpha .6) "
          "around "
          "the light seen through the leaf. The engine adds the term without N.L, so f has it over |N.L|; the wrap "
          "reaches N.L = 1/2 on the near side."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    Vec3<T> subsurface_color;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(p.subsurface_color, unreal_subsurface_color_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    // (wrap - N·L)/(1 + wrap)², wrap = ½: over the sphere its integral is π, that of N·L over its hemisphere.
    const G wrap = let("wrap", saturate((0.5 - g.cos_theta_i) / 2.25));
    const G through = let("through", saturate(-g.cos_light_view));
    const G lobe = let("through_lobe", call<GgxDistribution>(1.0 - square(through), 0.6));
    Vec3<T> scattered = let("scattered", p.subsurface_color * (wrap * lobe));
    return unreal_default_lit(p, g) + over_cosine(scattered, g.cos_theta_i);
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return lobes(p, wo).sample(wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return lobes(p, wo).pdf(wi, wo);
  }

 private:
  static UnrealLobes lobes(const Parameters<double>& p, const Direction& wo) {
    return {p, unreal_alpha(p.roughness), wo, mean_of(p.subsurface_color)};
  }
};

}  // namespace lobefit
