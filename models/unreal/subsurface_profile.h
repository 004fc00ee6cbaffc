// Unreal's SubsurfaceProfile: skin with two specular lobes.
#pragma once

#include "models/unreal/default_lit.h"

namespace lobefit {

struct UnrealSubsurfaceProfile {
  static constexpr ModelInfo info{
      .name = "unreal_subsurface_profile",
      .title = "Unreal Engine 4 SubsurfaceProfile",
      .source = "Unreal Engine 4, SubsurfaceProfileBxDF and DualSpecularGGX (named in S4), as publicly described",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "Two GGX densities, of roughness times either scale, mixed under one visibility of their mean roughness. "
          "The diffuse part is spread over the screen by the profile (Burley's normalised diffusion); what of that is "
          "a BRDF is its limit for a light and a surface that are even over the mean free path: Lambert. "
          "(The engine's spread starts from Burley's diffuse: the model burley.) Defaults of the profile: scales .75 "
          "and 1.3, mix .85. Opacity below .1 leads both lobes back to DefaultLit's."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    T opacity, first_roughness_scale, second_roughness_scale, lobe_mix;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(p.opacity, ParameterInfo{.name = "opacity",
                                   .symbol = "o",
                                   .initial = 1.0,
                                   .tier = Tier::advanced,
                                   .doc = "From .1 on the profile has its full effect."});
    visit(p.first_roughness_scale, ParameterInfo{.name = "first_roughness_scale",
                                                 .symbol = "s_0",
                                                 .upper = 2.0,
                                                 .initial = 0.75,
                                                 .doc = "Roughness of the first lobe, over that of the surface."});
    visit(p.second_roughness_scale, ParameterInfo{.name = "second_roughness_scale",
                                                  .symbol = "s_1",
                                                  .upper = 2.0,
                                                  .initial = 1.3,
                                                  .doc = "Roughness of the second lobe, over that of the surface."});
    visit(p.lobe_mix,
          ParameterInfo{.name = "lobe_mix", .symbol = "w", .initial = 0.85, .doc = "Share of the second lobe."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T effect = let("effect", saturate(10.0 * p.opacity));
    const T first_scale = let("first_scale", lerp(1.0, p.first_roughness_scale, effect));
    const T second_scale = let("second_scale", lerp(1.0, p.second_roughness_scale, effect));
    const T first = let("first", unreal_alpha(saturate(p.roughness * first_scale)));
    const T second = let("second", unreal_alpha(saturate(p.roughness * second_scale)));
    const T mean_scale = let("mean_scale", lerp(first_scale, second_scale, p.lobe_mix));
    const T mean = let("mean", unreal_alpha(saturate(p.roughness * mean_scale)));
    const T first_d = let("first_d", call<GgxDistribution>(g.sin2_theta_h, first));
    const T second_d = let("second_d", call<GgxDistribution>(g.sin2_theta_h, second));
    // Not by lerp(): next to a sharp lobe of weight 0 the other would drown in rounding.
    const T d = let("d", first_d * (1.0 - p.lobe_mix) + second_d * p.lobe_mix);
    const T visibility = let("visibility", call<SmithJointApproximation>(g.cos_theta_i, g.cos_theta_o, mean));
    Vec3<T> fresnel = let("fresnel", unreal_fresnel(g.cos_theta_d, unreal_specular_color(p)));
    return unreal_diffuse_color(p) / pi + fresnel * (d * visibility);
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, std::array<double, 2> u) {
    const std::size_t lobe = pick_lobe(std::array{1.0 - p.lobe_mix, p.lobe_mix}, u);
    return lobes(p, wo)[lobe].sample(wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    const std::array<UnrealLobes, 2> both = lobes(p, wo);
    return lerp(both[0].pdf(wi, wo), both[1].pdf(wi, wo), p.lobe_mix);
  }

 private:
  static std::array<UnrealLobes, 2> lobes(const Parameters<double>& p, const Direction& wo) {
    const double effect = saturate(10.0 * p.opacity);
    const auto lobe = [&](double scale) {
      return UnrealLobes(p, unreal_alpha(saturate(p.roughness * lerp(1.0, scale, effect))), wo);
    };
    return {lobe(p.first_roughness_scale), lobe(p.second_roughness_scale)};
  }
};

}  // namespace lobefit
