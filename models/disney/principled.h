// Disney's principled BRDF (S4's form of disney.brdf).
#pragma once

#include "models/diffuse/burley.h"
#include "models/diffuse/disney_subsurface.h"
#include "models/microfacet/sampling.h"
#include "models/sampling.h"
#include "models/specular/ggx.h"

namespace lobefit {

/// Hue and saturation of a linear colour: the colour over its luminance, 1 for black.
///
/// Disney's quotient jumps to 1 at black, and its slope next to it is unbounded. 1e-12 on both sides closes the jump:
/// nothing that 10 bits of base colour can encode moves by more than 5e-5 of itself, and black is still exactly 1.
struct DisneyTint {
  static constexpr const char* name = "disney_tint";
  static constexpr std::array arguments{"color"};

  template <class T>
  LOBEFIT_TEXT static auto evaluate(const Vec3<T>& color) {
    const auto luminance = let("luminance", 0.3 * color.x + 0.6 * color.y + 0.1 * color.z);
    return (color + 1e-12) / (luminance + 1e-12);
  }
};

/// G1/(2 cos θ) of GGX facets from the stretched length of a direction: the product of light's and view's is G/(4 N·L
/// N·V), uncorrelated.
struct SmithGgxSeparableVisibility {
  static constexpr const char* name = "smith_ggx_separable";
  static constexpr std::array arguments{"cos_theta", "length"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta, const T& length) {
    return 1.0 / (cos_theta + length);
  }
};

struct Disney {
  static constexpr ModelInfo info{
      .name = "disney",
      .title = "Disney principled BRDF",
      .source = "Burley 2012, Physically Based Shading at Disney, section 5 and appendix B; disney.brdf (S4)",
      .reciprocal = true,
      .energy_conserving = false,
      .isotropic = false,
      .doc =
          "Burley's diffuse, subsurface and sheen under anisotropic GGX and a GTR1 clear coat. Not energy conserving: "
          "the lobes are added, and the albedo of the diffuse ones alone passes 1. base_color is gamma-encoded: its "
          "power 2.2 is the linear colour. The specular G is Smith's for alpha = roughness^2, as in the revised "
          "disney.brdf; the code of 2012 remapped the roughness of G alone, to alpha = (.5 + .5 roughness)^2. The "
          "printed code gives GTR1 1/pi from alpha = 1 on; here alpha ends at .1."};

  template <class T>
  struct Parameters {
    Vec3<T> base_color;
    T metallic, roughness, specular, specular_tint, anisotropic, subsurface, sheen, sheen_tint, clearcoat,
        clearcoat_gloss;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.base_color, ParameterInfo{.name = "base_color",
                                      .symbol = "c",
                                      .initial = 0.7,
                                      .doc = "Surface colour, gamma-encoded (2.2) Rec.709 RGB."});
    visit(p.metallic,
          ParameterInfo{.name = "metallic",
                        .symbol = "m",
                        .doc = "0 a dielectric, 1 a metal: no diffuse part, and base_color as reflectance."});
    visit(p.roughness, roughness_parameter);
    visit(p.specular, ParameterInfo{.name = "specular",
                                    .symbol = "s",
                                    .initial = 0.5,
                                    .doc = "Reflectance of a dielectric at normal incidence, over .08."});
    visit(p.specular_tint,
          ParameterInfo{.name = "specular_tint",
                        .symbol = "s_t",
                        .tier = Tier::advanced,
                        .doc = "How much the specular reflectance of a dielectric takes base_color's hue."});
    visit(p.anisotropic,
          ParameterInfo{.name = "anisotropic",
                        .symbol = "a",
                        .tier = Tier::advanced,
                        .doc = "alpha_x, alpha_y = alpha / sqrt(1 - .9 a), alpha sqrt(1 - .9 a), at least .001."});
    visit(p.subsurface, ParameterInfo{.name = "subsurface",
                                      .symbol = "ss",
                                      .doc = "Share of the flat-material subsurface shape in the diffuse part."});
    visit(p.sheen, ParameterInfo{.name = "sheen", .symbol = "sh", .doc = "Grazing lobe of cloth, over the diffuse."});
    visit(p.sheen_tint, ParameterInfo{.name = "sheen_tint",
                                      .symbol = "sh_t",
                                      .initial = 0.5,
                                      .tier = Tier::advanced,
                                      .doc = "How much the sheen takes base_color's hue."});
    visit(p.clearcoat, ParameterInfo{.name = "clearcoat",
                                     .symbol = "cc",
                                     .doc = "Strength of a second, colourless lobe of index 1.5; 1 weighs it by .25."});
    visit(p.clearcoat_gloss, ParameterInfo{.name = "clearcoat_gloss",
                                           .symbol = "cc_g",
                                           .initial = 1.0,
                                           .doc = "Gloss of the clear coat: GTR1 alpha from .1 to .001."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    Vec3<T> white{T(1.0), T(1.0), T(1.0)};
    Vec3<T> color = let("color", Vec3<T>{pow(p.base_color.x, 2.2), pow(p.base_color.y, 2.2), pow(p.base_color.z, 2.2)});
    Vec3<T> tint = let("tint", call<DisneyTint>(color));
    const G fresnel = let("fresnel", call<Pow5>(1.0 - g.cos_theta_d));

    const T diffuse = let("diffuse", call<BurleyFactor>(g.cos_theta_i, g.cos_theta_o, g.cos_theta_d, p.roughness));
    const T subsurface =
        let("subsurface", call<DisneySubsurfaceFactor>(g.cos_theta_i, g.cos_theta_o, g.cos_theta_d, p.roughness));
    Vec3<T> base = let("base", color / pi * lerp(diffuse, subsurface, p.subsurface));
    Vec3<T> sheen = let("sheen", lerp(white, tint, p.sheen_tint) * (p.sheen * fresnel));

    Vec3<T> dielectric = let("dielectric", lerp(white, tint, p.specular_tint) * (0.08 * p.specular));
    Vec3<T> f0 = let("f0", lerp(dielectric, color, p.metallic));
    Vec3<T> specular = let("specular", lerp(f0, white, fresnel) * specular_lobe(alphas(p), g));

    const T coat = let("coat", p.clearcoat * 0.25 * (lerp(0.04, 1.0, fresnel) * coat_lobe(coat_alpha(p), g)));
    return (base + sheen) * (1.0 - p.metallic) + specular + coat;
  }

  /// The cosine for diffuse and sheen, the facets that wo sees for the specular lobe, GTR1 facets for the clear coat.
  static Direction sample(const Parameters<double>& p, const Direction& wo, std::array<double, 2> u) {
    switch (pick_lobe(shares(p, wo), u)) {
      case 0: return sample_cosine(u);
      case 1: return sample_visible_reflection(Distribution::ggx, sampled_alphas(p), wo, u);
      default: return reflect(wo, sample_gtr1_facet(coat_alpha(p), u));
    }
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    const std::array<double, 3> share = shares(p, wo);
    const double specular = visible_reflection_density(Distribution::ggx, sampled_alphas(p), wi, wo);
    const double coat = reflected_density(wi, wo, [&](const Direction& m) {
      return Gtr1Distribution::evaluate(m.x * m.x + m.y * m.y, coat_alpha(p)) * max(m.z, 0.0);
    });
    return share[0] * cosine_density(wi) + share[1] * specular + share[2] * coat;
  }

 private:
  /// Disney's limit.
  static constexpr double smallest_disney_alpha = 1e-3;

  template <class T>
  LOBEFIT_TEXT static AlphaPair<T> alphas(const Parameters<T>& p) {
    const AlphaPair<T> alpha = BurleyAnisotropy::evaluate(let("alpha", square(p.roughness)), p.anisotropic);
    return {max(alpha.x, smallest_disney_alpha), max(alpha.y, smallest_disney_alpha)};
  }
  template <class T>
  LOBEFIT_TEXT static T coat_alpha(const Parameters<T>& p) {
    return lerp(0.1, 0.001, p.clearcoat_gloss);
  }

  template <class T, class G>
  LOBEFIT_TEXT static T specular_lobe(const AlphaPair<T>& alpha, const Geometry<G>& g) {
    const T ax = let("ax", alpha.x);
    const T ay = let("ay", alpha.y);
    const T light =
        let("vis_light", call<SmithGgxSeparableVisibility>(g.cos_theta_i, call<StretchedVectorLength>(g.wi, ax, ay)));
    const T view =
        let("vis_view", call<SmithGgxSeparableVisibility>(g.cos_theta_o, call<StretchedVectorLength>(g.wo, ax, ay)));
    return let("d_specular", call<GgxAnisotropicDistribution>(g.h, ax, ay)) * (light * view);
  }
  template <class T, class G>
  LOBEFIT_TEXT static T coat_lobe(const T& alpha, const Geometry<G>& g) {
    constexpr double masking_alpha = 0.25;
    const G light = let("vis_coat_light", call<SmithGgxSeparableVisibility>(
                                              g.cos_theta_i, call<StretchedLength>(g.cos_theta_i, masking_alpha)));
    const G view = let("vis_coat_view", call<SmithGgxSeparableVisibility>(
                                            g.cos_theta_o, call<StretchedLength>(g.cos_theta_o, masking_alpha)));
    return let("d_coat", call<Gtr1Distribution>(g.sin2_theta_h, alpha)) * (light * view);
  }

  static Alpha sampled_alphas(const Parameters<double>& p) {
    const AlphaPair<double> alpha = alphas(p);
    return {alpha.x, alpha.y};
  }
  /// Facets of density D cos θ_m: cos² θ_m = (1 - α^(2 (1 - u)))/(1 - α²) (Burley 2012, appendix B.2).
  static Direction sample_gtr1_facet(double alpha, const std::array<double, 2>& u) {
    const double alpha2 = alpha * alpha;
    const double sine = sqrt((std::pow(alpha2, 1.0 - u[0]) - alpha2) / (1.0 - alpha2)), azimuth = 2.0 * pi * u[1];
    return {sine * std::cos(azimuth), sine * std::sin(azimuth), sqrt(1.0 - sine * sine)};
  }
  /// Diffuse, specular, clear coat: in proportion to rough estimates of their albedos.
  static std::array<double, 3> shares(const Parameters<double>& p, const Direction& wo) {
    const double fresnel = pow5(1.0 - wo.z);
    const auto linear = [](double c) { return std::pow(max(c, 0.0), 2.2); };
    const double color = (linear(p.base_color.x) + linear(p.base_color.y) + linear(p.base_color.z)) / 3.0;
    const double diffuse = (1.0 - p.metallic) * (color + 0.1 * p.sheen) + 1e-3;
    const double specular = lerp(lerp(0.08 * p.specular, color, p.metallic), 1.0, fresnel) + 1e-3;
    const double coat = 0.25 * p.clearcoat * lerp(0.04, 1.0, fresnel);
    const double sum = diffuse + specular + coat;
    return {diffuse / sum, specular / sum, coat / sum};
  }
};

}  // namespace lobefit
