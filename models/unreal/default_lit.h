// Unreal Engine 4's DefaultLit, and what its other shading models share with it.
//
// S4 counts thirteen shading models. Which function each one is:
//   DefaultLit, SingleLayerWater, ThinTranslucent   unreal_default_lit (water and glass differ in what is behind)
//   Subsurface                                      unreal_subsurface
//   PreintegratedSkin                               unreal_preintegrated_skin
//   ClearCoat                                       unreal_clear_coat
//   SubsurfaceProfile                               unreal_subsurface_profile
//   TwoSidedFoliage                                 unreal_two_sided_foliage
//   Hair                                            hair_unreal
//   Cloth                                           unreal_cloth
//   Eye                                             unreal_eye
//   Unlit                                           reflects nothing
//   FromMaterialExpression                          chooses one of these for each pixel
// Parameters are the pins of the material. Two pins of every model aren't here, since no BRDF has them: emissive
// colour, which is light of the surface's own, and the normal, which is z here. Ambient occlusion is a parameter where
// the direct light's function reads it.
//
// The engine adds what a transmitting model scatters without multiplying it by N·L: to a light of irradiance E on the
// plane that faces it, the surface answers with T E. A BRDF answers with f |N·L| E, so f = T/|N·L| there. That pole is
// no flaw of f: whoever multiplies by the cosine again gets the engine's term, next to the horizon too, and the
// integrals of f |N·L| are those of T. See over_cosine().
#pragma once

#include "models/microfacet/fresnel.h"
#include "models/microfacet/masking.h"
#include "models/microfacet/normal_distribution.h"
#include "models/microfacet/sampling.h"
#include "models/sampling.h"
#include "models/specular/ggx.h"

namespace lobefit {

/// The pins of every lit model.
template <class T>
struct UnrealSurface {
  Vec3<T> base_color;
  T metallic, specular, roughness;
};

template <class P, class Visit>
constexpr void describe_unreal_surface(P& p, Visit&& visit) {
  visit(
      p.base_color,
      ParameterInfo{.name = "base_color", .symbol = "c", .initial = 0.5, .doc = "Surface colour, linear Rec.709 RGB."});
  visit(p.metallic, ParameterInfo{.name = "metallic",
                                  .symbol = "m",
                                  .doc = "0 a dielectric, 1 a metal: no diffuse part, and base_color as reflectance."});
  visit(p.specular, ParameterInfo{.name = "specular",
                                  .symbol = "s",
                                  .initial = 0.5,
                                  .doc = "Reflectance of a dielectric at normal incidence, over .08."});
  visit(p.roughness, roughness_parameter);
}

/// Alphas end here, as the engine's anisotropic ones do.
inline constexpr double smallest_unreal_alpha = 1e-3;

template <class T>
LOBEFIT_TEXT T unreal_alpha(const T& roughness) {
  return max(square(roughness), smallest_unreal_alpha);
}

template <class T>
LOBEFIT_TEXT Vec3<T> unreal_diffuse_color(const UnrealSurface<T>& p) {
  return let("diffuse_color", p.base_color * (1.0 - p.metallic));
}

struct UnrealSpecularColor {
  static constexpr const char* name = "unreal_specular_color";
  static constexpr std::array arguments{"base_color", "metallic", "specular"};

  template <class T>
  LOBEFIT_TEXT static auto evaluate(const Vec3<T>& base_color, const T& metallic, const T& specular) {
    return base_color * metallic + 0.08 * specular * (1.0 - metallic);
  }
};

template <class T>
LOBEFIT_TEXT Vec3<T> unreal_specular_color(const UnrealSurface<T>& p) {
  return let("specular_color", call<UnrealSpecularColor>(p.base_color, p.metallic, p.specular));
}

/// The engine's isotropic SpecularGGX without its Fresnel term: D V.
struct UnrealGgx {
  static constexpr const char* name = "unreal_ggx";
  static constexpr std::array arguments{"sin2_theta_h", "cos_theta_i", "cos_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& sin2_theta_h, const G& cos_theta_i, const G& cos_theta_o, const T& alpha) {
    return call<GgxDistribution>(sin2_theta_h, alpha) * call<SmithJointApproximation>(cos_theta_i, cos_theta_o, alpha);
  }
};

/// F_Schlick of a specular colour.
template <class T, class G>
LOBEFIT_TEXT Vec3<T> unreal_fresnel(const G& cosine, const Vec3<T>& specular_color) {
  return call<UnrealFresnel>(cosine, specular_color, specular_color.y);
}

/// DefaultLit without anisotropy: what most other models build on. 0 for light from behind.
template <class T, class G>
LOBEFIT_TEXT Vec3<T> unreal_default_lit(const UnrealSurface<T>& p, const Geometry<G>& g) {
  // Models that transmit come here with light from behind too.
  const G cos_theta_i = let("cos_light", max(g.cos_theta_i, 0.0));
  const T lobe = let("lobe", call<UnrealGgx>(g.sin2_theta_h, cos_theta_i, g.cos_theta_o, unreal_alpha(p.roughness)));
  Vec3<T> fresnel = let("fresnel", unreal_fresnel(g.cos_theta_d, unreal_specular_color(p)));
  Vec3<T> reflected = let("reflected", unreal_diffuse_color(p) / pi + fresnel * lobe);
  return select(g.cos_theta_i > 0.0, reflected, Vec3<T>{T(0.0), T(0.0), T(0.0)});
}

/// f of what the engine adds without N·L (see the top of this file). Within 1e-36 of the horizon, beyond what a float
/// direction can say, f stays finite.
template <class T, class G>
LOBEFIT_TEXT Vec3<T> over_cosine(const Vec3<T>& term, const G& cos_theta_i) {
  return term / max(abs(cos_theta_i), smallest_base);
}

// ---- sampling -----------------------------------------------------------------------------------------------------

inline double mean_of(const Rgb& c) { return (c.x + c.y + c.z) / 3.0; }

/// Lobes to sample in shares: the cosine, the facets that wo sees, and the uniform sphere. What is scattered has f
/// |N·L| without a zero at the horizon: sampled by the cosine alone, its weights would be unbounded there.
struct UnrealLobes {
  Alpha alpha;
  std::array<double, 3> shares;  // add up to 1

  /// `scattered`: roughly the albedo of what the engine adds without N·L.
  UnrealLobes(const UnrealSurface<double>& p, Alpha facets, const Direction& wo, double scattered = 0.0)
      : alpha(facets) {
    const double f0 = mean_of(UnrealSpecularColor::evaluate(p.base_color, p.metallic, p.specular));
    const double diffuse = mean_of(p.base_color) * (1.0 - p.metallic) + 1e-3;
    const double specular = lerp(f0, 1.0, pow5(1.0 - wo.z)) + 1e-3;
    const double sum = diffuse + specular + scattered;
    shares = {diffuse / sum, specular / sum, scattered / sum};
  }

  Direction sample(const Direction& wo, std::array<double, 2> u) const {
    switch (pick_lobe(shares, u)) {
      case 0: return sample_cosine(u);
      case 1: return sample_visible_reflection(Distribution::ggx, alpha, wo, u);
      default: return sample_sphere(u);
    }
  }
  double pdf(const Direction& wi, const Direction& wo) const {
    const double specular = visible_reflection_density(Distribution::ggx, alpha, wi, wo);
    return shares[0] * cosine_density(wi) + shares[1] * specular + shares[2] * sphere_density;
  }
};

// ---- the model ----------------------------------------------------------------------------------------------------

struct UnrealDefaultLit {
  static constexpr ModelInfo info{
      .name = "unreal_default_lit",
      .title = "Unreal Engine 4 DefaultLit",
      .source = "Unreal Engine 4, DefaultLitBxDF (S4); Karis 2013, Real Shading in Unreal Engine 4",
      .reciprocal = true,
      .energy_conserving = false,
      .isotropic = false,
      .doc =
          "Lambert plus GGX with the approximate joint Smith visibility and a Schlick term whose grazing reflection "
          "goes out below 2 %. Serves SingleLayerWater and ThinTranslucent too; Unlit reflects nothing, and "
          "FromMaterialExpression chooses among the other models. Emissive colour and normal are no part of a BRDF. "
          "Anisotropic surfaces have the exact joint Smith visibility, as in the engine: where anisotropy leaves 0 the "
          "lobe jumps by a factor of up to sqrt(2/(1 + alpha)), for light and view about alpha above the horizon."};

  template <class T>
  struct Parameters : UnrealSurface<T> {
    T anisotropy;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_unreal_surface(p, visit);
    visit(p.anisotropy, ParameterInfo{.name = "anisotropy",
                                      .symbol = "a",
                                      .lower = -1.0,
                                      .upper = 1.0,
                                      .tier = Tier::advanced,
                                      .doc = "alpha_x, alpha_y = alpha (1 + a), alpha (1 - a), at least .001."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T alpha = let("alpha", unreal_alpha(p.roughness));
    const AlphaPair<T> both = alphas(p);
    const T x = let("ax", both.x);
    const T y = let("ay", both.y);
    // D alone goes smoothly through anisotropy 0: its derivative there is what leads a fit away from it.
    const T d = let("d", call<GgxAnisotropicDistribution>(g.h, x, y));
    const T vis_joint =
        let("vis_joint", call<SmithGgxVisibility>(g.cos_theta_i, call<StretchedVectorLength>(g.wi, x, y), g.cos_theta_o,
                                                  call<StretchedVectorLength>(g.wo, x, y)));
    const T visibility = let("visibility", select(abs(p.anisotropy) > 0.0, vis_joint,
                                                  call<SmithJointApproximation>(g.cos_theta_i, g.cos_theta_o, alpha)));
    Vec3<T> fresnel = let("fresnel", unreal_fresnel(g.cos_theta_d, unreal_specular_color(p)));
    return unreal_diffuse_color(p) / pi + fresnel * (d * visibility);
  }

  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return lobes(p, wo).sample(wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return lobes(p, wo).pdf(wi, wo);
  }

 private:
  template <class T>
  LOBEFIT_TEXT static AlphaPair<T> alphas(const Parameters<T>& p) {
    const AlphaPair<T> alpha = KullaContyAnisotropy::evaluate(square(p.roughness), p.anisotropy);
    return {max(alpha.x, smallest_unreal_alpha), max(alpha.y, smallest_unreal_alpha)};
  }
  static UnrealLobes lobes(const Parameters<double>& p, const Direction& wo) {
    const AlphaPair<double> alpha = alphas(p);
    return {p, {alpha.x, alpha.y}, wo};
  }
};

}  // namespace lobefit
