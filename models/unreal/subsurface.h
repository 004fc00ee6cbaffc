// Unreal's Subsurface: light that comes through, by two lobes without a medium.
#pragma once

#include "models/unreal/default_lit.h"

namespace lobefit {

inline constexpr ParameterInfo unreal_subsurface_color_parameter{
    .name = "subsurface_color", .symbol = "c_s", .initial = 0.5, .doc = "Colour of what is scattered, linear RGB."};

/// sat(-V·L)¹² lerp(3, .1, opacity): the light seen through the body.
struct UnrealInScatter {
  static constexpr const char* name = "unreal_in_scatter";
  static constexpr std::array arguments{"cos_light_view", "opacity"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_light_view, const T& opacity) {
    const auto through = let("through", saturate(-cos_light_view));
    const auto through3 = let("through3", through * through * through);
    return square(square(through3)) * lerp(3.0, 0.1, opacity);
  }
};

/// ((N·L + ½)/(1 + ½))^1.5 5/3: diffuse light wrapped around the terminator. Its integral over
/// the sphere is 2π, so that over 2π it scatters as much as Lambert.
struct UnrealWrap {
  static constexpr const char* name = "unreal_wrap";
  static constexpr std::array arguments{"cos_theta_i"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i) {
    const auto base = let("base", saturate((cos_theta_i + 0.5) / 1.5));
    return base * sqrt(base) * (2.5 / 1.5);
  }
};

struct UnrealSubsurface {
  static constexpr ModelInfo info{
      .name = "unreal_subsurface",
      .title = "Unreal Engine 4 Subsurface",
      .source = "Unreal Engine 4, SubsurfaceBxDF (named in S4), as publicly described",
      .reciprocal = false,
      .energy_conserving = false,
      .transmits = true,
      .doc =
          "DefaultLit plus subsurface_color times lerp(back, 1, in-scatter): back is wrapped light over 2 pi, "
          "in-scatter a lobe around the light seen through the body. The engine adds the term without N.L, so f has "
          "it over |N.L|. In-scatter passes 1 below opacity .69, and the blend extrapolates; at opacity 0 the term's "
          "albedo alone is 3.22."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    T opacity;
    Vec3<T> subsurface_color;
    T ambient_occlusion;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(p.opacity, ParameterInfo{.name = "opacity",
                                   .symbol = "o",
                                   .initial = 0.5,
                                   .doc = "0 scatters light whatever the normal, 1 wraps it around the normal."});
    visit(p.subsurface_color, unreal_subsurface_color_parameter);
    visit(p.ambient_occlusion, ParameterInfo{.name = "ambient_occlusion",
                                             .symbol = "AO",
                                             .initial = 1.0,
                                             .tier = Tier::advanced,
                                             .doc = "Scales what is scattered back; 1 is an open surface."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T in_scatter = let("in_scatter", call<UnrealInScatter>(g.cos_light_view, p.opacity));
    const T back =
        let("back", p.ambient_occlusion / (2.0 * pi) * lerp(1.0, call<UnrealWrap>(g.cos_theta_i), p.opacity));
    Vec3<T> scattered = let("scattered", p.subsurface_color * lerp(back, 1.0, in_scatter));
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
    return {p, unreal_alpha(p.roughness), wo, 2.0 * mean_of(p.subsurface_color)};
  }
};

}  // namespace lobefit
