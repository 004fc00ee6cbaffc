// Unreal's Eye: a glossy cornea over an iris with a caustic.
#pragma once

#include "models/unreal/default_lit.h"

namespace lobefit {

/// Light on the iris: the cosine with the eye's axis, focussed by the cornea. The caustic lies around `focus`, and is
/// wide (power 1) where light comes along the axis, narrow (power 12) where it comes from the side.
struct UnrealIris {
  static constexpr const char* name = "unreal_iris";
  static constexpr std::array arguments{"wi", "axis", "focus"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const Vec3<G>& wi, const Vec3<T>& axis, const Vec3<T>& focus) {
    const auto cosine = let("cosine", saturate(dot(axis, wi)));
    const auto power = let("power", lerp(12.0, 1.0, cosine));
    const auto caustic = let("caustic", 0.8 + 0.2 * (power + 1.0) * pow(saturate(dot(focus, wi)), power));
    return cosine * caustic;
  }
};

struct UnrealEye {
  static constexpr ModelInfo info{
      .name = "unreal_eye",
      .title = "Unreal Engine 4 Eye",
      .source = "Unreal Engine 4, EyeBxDF (named in S4), as publicly described",
      .reciprocal = false,
      .energy_conserving = false,
      .isotropic = false,
      .transmits = true,
      .doc =
          "One GGX lobe over Lambert dimmed by 1 - F(V.H), and over the iris mask an iris lit by N'.L of the eye's "
          "axis N' times a caustic of .8 + .2 (p + 1) (C.L)^p. The normals that the engine takes from textures are "
          "here the cornea's, z, and the eye's axis, tilted towards +x by iris_tilt, which is the iris normal too; "
          "iris_distance bends the caustic's C from the axis towards -z. The engine adds the iris without N.L, so f "
          "has it over |N.L|, and a tilted iris sees light from below the cornea's horizon. Pins of S4 without a part "
          "in it: opacity, ambient occlusion."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    T iris_mask, iris_distance, iris_tilt;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(p.iris_mask,
          ParameterInfo{.name = "iris_mask", .symbol = "k", .initial = 1.0, .doc = "0 the white of the eye, 1 iris."});
    visit(p.iris_distance,
          ParameterInfo{.name = "iris_distance",
                        .symbol = "d",
                        .initial = 0.1,
                        .doc = "Depth of the iris below the cornea: how far the caustic moves away from the light."});
    visit(p.iris_tilt, ParameterInfo{.name = "iris_tilt",
                                     .symbol = "t",
                                     .upper = 0.9,
                                     .tier = Tier::advanced,
                                     .doc = "Sine of the angle between the eye's axis and the cornea's normal."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const G cos_theta_i = let("cos_light", max(g.cos_theta_i, 0.0));
    Vec3<T> white{T(1.0), T(1.0), T(1.0)};
    Vec3<T> specular_color = unreal_specular_color(p);
    Vec3<T> fresnel = let("fresnel", lerp(specular_color, white, call<Pow5>(1.0 - g.cos_theta_d)));
    Vec3<T> refracted = let("refracted", call<SchlickTransmittance>(g.cos_theta_d, specular_color));
    const T lobe = let("lobe", call<UnrealGgx>(g.sin2_theta_h, cos_theta_i, g.cos_theta_o, unreal_alpha(p.roughness)));
    const T cornea = let("cornea", select(g.cos_theta_i > 0.0, lobe, T(0.0)));

    Vec3<T> axis = let("axis", Vec3<T>{p.iris_tilt, T(0.0), sqrt(1.0 - square(p.iris_tilt))});
    const T depth = let("depth", p.iris_mask * p.iris_distance);
    Vec3<T> bent = let("bent", axis * (1.0 - depth));
    Vec3<T> focus = let("focus", normalize(Vec3<T>{bent.x, bent.y, bent.z - depth}));
    const T lit = let("lit", lerp(cos_theta_i, call<UnrealIris>(g.wi, axis, focus), p.iris_mask));
    return fresnel * cornea + unreal_diffuse_color(p) / pi * refracted * (lit / max(abs(g.cos_theta_i), smallest_base));
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return lobes(p, wo).sample(wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return lobes(p, wo).pdf(wi, wo);
  }

 private:
  static UnrealLobes lobes(const Parameters<double>& p, const Direction& wo) {
    return {p, unreal_alpha(p.roughness), wo, p.iris_mask * (0.05 + p.iris_tilt) * mean_of(p.base_color)};
  }
};

}  // namespace lobefit
