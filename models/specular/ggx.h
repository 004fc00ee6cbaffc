// The GGX lobe, as specular_ggx and as what other models are made of.
#pragma once

#include "models/microfacet/anisotropy.h"
#include "models/microfacet/fresnel.h"
#include "models/microfacet/masking.h"
#include "models/microfacet/normal_distribution.h"
#include "models/microfacet/sampling.h"
#include "models/specular/term.h"

namespace lobefit {

/// D V of GGX facets with height-correlated Smith masking. `alpha` may be 0 (see smallest_alpha).
struct GgxLobe {
  static constexpr const char* name = "ggx_lobe";
  static constexpr std::array arguments{"sin2_theta_h", "cos_theta_i", "cos_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static T evaluate(const G& sin2_theta_h, const G& cos_theta_i, const G& cos_theta_o, const T& alpha) {
    const T a = let("a", max(alpha, smallest_alpha));
    const T length_i = let("length_i", call<StretchedLength>(cos_theta_i, a));
    const T length_o = let("length_o", call<StretchedLength>(cos_theta_o, a));
    const T visibility = let("visibility", call<SmithGgxVisibility>(cos_theta_i, length_i, cos_theta_o, length_o));
    return call<GgxDistribution>(sin2_theta_h, a) * visibility;
  }
};

/// The lobe of a pair of directions: times a Fresnel term it is the BRDF.
///
///   f = ggx_lobe(alpha, g) * call<SchlickFresnel>(g.cos_theta_d, f0, f90);
template <class T, class G>
LOBEFIT_TEXT T ggx_lobe(const T& alpha, const Geometry<G>& g) {
  return call<GgxLobe>(g.sin2_theta_h, g.cos_theta_i, g.cos_theta_o, alpha);
}

/// √((αx x)² + (αy y)² + z²): see StretchedLength.
struct StretchedVectorLength {
  static constexpr const char* name = "stretched_vector_length";
  static constexpr std::array arguments{"w", "alpha_x", "alpha_y"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const Vec3<G>& w, const T& alpha_x, const T& alpha_y) {
    return sqrt(square(alpha_x * w.x) + square(alpha_y * w.y) + square(w.z));
  }
};

/// The same with a roughness along x and one along y.
template <class T, class G>
LOBEFIT_TEXT T ggx_lobe(const AlphaPair<T>& alpha, const Geometry<G>& g) {
  const T x = max(alpha.x, smallest_alpha);
  const T y = max(alpha.y, smallest_alpha);
  const T length_i = let("length_i", call<StretchedVectorLength>(g.wi, x, y));
  const T length_o = let("length_o", call<StretchedVectorLength>(g.wo, x, y));
  const T visibility = let("visibility", call<SmithGgxVisibility>(g.cos_theta_i, length_i, g.cos_theta_o, length_o));
  return let("d", call<GgxAnisotropicDistribution>(g.h, x, y)) * visibility;
}

inline constexpr ParameterInfo specular_f0_parameter{
    .name = "f0", .symbol = "F_0", .initial = 0.04, .doc = "Reflectance at normal incidence, linear Rec.709 RGB."};
inline constexpr ParameterInfo specular_f90_parameter{.name = "f90",
                                                      .symbol = "F_90",
                                                      .initial = 1.0,
                                                      .tier = Tier::advanced,
                                                      .doc = "Reflectance at grazing angles, linear Rec.709 RGB."};

struct SpecularGgx {
  static constexpr ModelInfo info{
      .name = "specular_ggx",
      .title = "GGX microfacet specular",
      .source = "Walter et al. 2007; Heitz 2014, Understanding the Masking-Shadowing Function; Schlick 1994",
      .reciprocal = true,
      .energy_conserving = true,
      .isotropic = false,
      .doc =
          "One bounce between GGX mirrors, height-correlated Smith masking, Schlick's Fresnel. Anisotropy as Kulla "
          "and Conty map it. Glints, which no smooth distribution has, are not modelled yet."};

  template <class T>
  struct Parameters {
    Vec3<T> f0, f90;
    T alpha, anisotropy;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.f0, specular_f0_parameter);
    visit(p.f90, specular_f90_parameter);
    visit(p.alpha, specular_alpha_parameter);
    visit(p.anisotropy, ParameterInfo{.name = "anisotropy",
                                      .symbol = "a",
                                      .lower = -0.9,
                                      .upper = 0.9,
                                      .initial = 0.0,
                                      .tier = Tier::advanced,
                                      .doc = "alpha_x = alpha (1 + a), alpha_y = alpha (1 - a)."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const Vec3<T> fresnel = let("fresnel", call<SchlickFresnel>(g.cos_theta_d, p.f0, p.f90));
    return fresnel * ggx_lobe(KullaContyAnisotropy::evaluate(p.alpha, p.anisotropy), g);
  }

  /// By the facets that wo sees.
  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return sample_visible_reflection(Distribution::ggx, alphas(p), wo, u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return visible_reflection_density(Distribution::ggx, alphas(p), wi, wo);
  }

 private:
  static Alpha alphas(const Parameters<double>& p) {
    const AlphaPair<double> alpha = KullaContyAnisotropy::evaluate(p.alpha, p.anisotropy);
    return {max(alpha.x, smallest_alpha), max(alpha.y, smallest_alpha)};
  }
};

}  // namespace lobefit
