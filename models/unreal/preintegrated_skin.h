// Unreal's PreintegratedSkin: DefaultLit, and light that a curved surface carries past the terminator.
#pragma once

#include "models/unreal/subsurface.h"

namespace lobefit {

/// Irradiance that a sphere shows under a distant light of 1, where N·L = cosine, after its surface has spread it by
/// Burley's normalised diffusion R(c) = (exp(-c/d) + exp(-c/3d))/(8π d c) over chords c. `curvature`: d over the
/// sphere's radius, in [0, 1]; flat is max(cosine, 0).
///
/// A fit of our own to ∫ (N'·L)⁺ R dA/∫ R dA, in the place of the engine's texture; off by at most 1.2e-3
/// (tests/unreal_test.cpp). Of the clamped cosine's halves, ½ μ + ½ |μ|, spreading scales the odd one, a spherical
/// harmonic; the even one becomes a rational function of |μ| that is flat at 0.
struct UnrealSkinIrradiance {
  static constexpr const char* name = "unreal_skin_irradiance";
  static constexpr std::array arguments{"cosine", "curvature"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cosine, const T& curvature) {
    const auto k = curvature;
    const auto odd = let("odd", (1.0 + k * (-1.186 + k * (20.28 - 12.25 * k))) /
                                    (1.0 + k * (-1.186 + k * (27.28 + k * (-2.366 - 9.365 * k)))));
    const auto peak = let("peak", (1.389 + 21.2 * k) / (1.0 + k * (8.454 + 50.92 * k)));
    const auto slope = let("slope", 1.052 + 2.149 * k);
    const auto bend = let("bend", 0.9923 + k * (0.3179 * k - 0.04784));
    const auto reach = let("reach", 0.2543 + k * (0.2657 + 0.09818 * k));
    const auto gain = let("gain", (1.0 + k * (19.26 * k - 1.881)) / (1.0 + k * (26.75 * k - 2.292)));

    const auto x = let("x", abs(cosine));
    const auto numerator = let("numerator", k * k * peak * (k + slope * x) + x * x * (k * bend + reach * gain * x));
    // Flat at cosine 0 it is 0/0.
    const auto denominator = let("denominator", max(k * (k + slope * x) + reach * x * x, smallest_base));
    return max(0.5 * (odd * cosine + numerator / denominator), 0.0);
  }
};

struct UnrealPreintegratedSkin {
  static constexpr ModelInfo info{
      .name = "unreal_preintegrated_skin",
      .title = "Unreal Engine 4 PreintegratedSkin",
      .source =
          "Unreal Engine 4, PreintegratedSkinBxDF (named in S4), as publicly described; Penner, Borshukov 2011, "
          "Pre-Integrated Skin Shading; Burley 2015, Extending the Disney BRDF",
      .reciprocal = false,
      .energy_conserving = false,
      .transmits = true,
      .doc =
          "DefaultLit plus subsurface_color times what the engine reads from a texture over (N.L/2 + 1/2, 1 - opacity) "
          "and adds without N.L; f has it over |N.L|. In the texture's place stands a fit to Burley's diffusion "
          "integrated over a sphere: 1 - opacity is the scattering distance of red over the sphere's radius, green "
          "scatters .37 and blue .3 as far (the engine's default profile). Opacity 1 leaves Lambert of "
          "subsurface_color beside that of base_color, and twice the light where both are bright."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    T opacity;
    Vec3<T> subsurface_color;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(p.opacity,
          ParameterInfo{
              .name = "opacity", .symbol = "o", .initial = 0.5, .doc = "1 - curvature times scattering distance."});
    visit(p.subsurface_color, unreal_subsurface_color_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T curvature = let("curvature", 1.0 - p.opacity);
    Vec3<T> irradiance = let("irradiance", Vec3<T>{call<UnrealSkinIrradiance>(g.cos_theta_i, curvature),
                                                   call<UnrealSkinIrradiance>(g.cos_theta_i, 0.37 * curvature),
                                                   call<UnrealSkinIrradiance>(g.cos_theta_i, 0.3 * curvature)});
    Vec3<T> scattered = let("scattered", p.subsurface_color / pi * irradiance);
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
