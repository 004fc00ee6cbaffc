// Masking and shadowing as model texts. G is the share of the facets of normal h that both directions see;
// f = D G F / (4 N·L N·V). V, the visibility, is G with that denominator.
//
// Source unless stated: Karis 2013, Specular BRDF Reference, in alpha = roughness². Its Smith forms are G1(l) G1(v),
// light and view uncorrelated.
#pragma once

#include "models/geometry.h"

namespace lobefit {

/// Visibilities end here, next to the horizon: D V stays finite in float. Reached only where a cosine is below 1e-23.
inline constexpr double smallest_visibility_denominator = 1e-27;

struct ImplicitMasking {
  static constexpr const char* name = "g_implicit";
  static constexpr const char* title = "Implicit geometry term";
  static constexpr const char* source = "Hoffman 2013, Background: Physics and Math of Shading; Karis 2013";
  static constexpr const char* doc = "Cancels the denominator, and leaves D F / 4.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o) {
    return cos_theta_i * cos_theta_o;
  }
  template <class G>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g) {
    return call<ImplicitMasking>(g.cos_theta_i, g.cos_theta_o);
  }
};

struct NeumannMasking {
  static constexpr const char* name = "g_neumann";
  static constexpr const char* title = "Neumann geometry term";
  static constexpr const char* source = "Neumann, Neumann, Szirmay-Kalos 1999, Compact Metallic Reflectance Models";
  static constexpr const char* doc = "The lower of the two cosines: N·L N·V / max(N·L, N·V).";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o) {
    return min(cos_theta_i, cos_theta_o);
  }
  template <class G>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g) {
    return call<NeumannMasking>(g.cos_theta_i, g.cos_theta_o);
  }
};

struct CookTorranceMasking {
  static constexpr const char* name = "g_cook_torrance";
  static constexpr const char* title = "Cook-Torrance geometry term";
  static constexpr const char* source = "Torrance, Sparrow 1967; Cook, Torrance 1982";
  static constexpr const char* doc = "V-shaped grooves, whatever their distribution.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "cos2_theta_d"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const G& cos2_theta_d) {
    // 2 N·H min(N·L, N·V)/(V·H), with N·H = (N·L + N·V)/(2 V·H).
    return min((cos_theta_i + cos_theta_o) * min(cos_theta_i, cos_theta_o) / max(cos2_theta_d, smallest_base), 1.0);
  }
  template <class G>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g) {
    return call<CookTorranceMasking>(g.cos_theta_i, g.cos_theta_o, square(g.cos_theta_d));
  }
};

struct KelemenMasking {
  static constexpr const char* name = "g_kelemen";
  static constexpr const char* title = "Kelemen geometry term";
  static constexpr const char* source = "Kelemen, Szirmay-Kalos 2001, A Microfacet Based Coupled BRDF Model";
  static constexpr const char* doc = "N·L N·V / (V·H)²: Cook-Torrance without its minimum.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "cos2_theta_d"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const G& cos2_theta_d) {
    return cos_theta_i * cos_theta_o / max(cos2_theta_d, smallest_base);
  }
  template <class G>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g) {
    return call<KelemenMasking>(g.cos_theta_i, g.cos_theta_o, square(g.cos_theta_d));
  }
};

/// Walter's rational fit to Smith's G1 of Beckmann facets over c = cot θ/α: (p1 c + p2 c²)/(1 + q1 c + q2 c²), 1 from
/// c = 1.6. As printed it passes 1 by up to 6.1e-05 between c = 1.548 and 1.6, where it steps down to 1: the minimum
/// removes both the excess and the step, on which float and double would disagree.
inline constexpr std::array walter_beckmann_constants{3.535, 2.181, 2.276, 2.577};  // p1, p2, q1, q2
template <class K, class T>
LOBEFIT_TEXT auto walter_beckmann_g1(const std::array<K, 4>& k, const T& cotangent) {
  const auto c = let("c", min(cotangent, 1.6));
  return min((k[0] * c + k[1] * c * c) / (1.0 + k[2] * c + k[3] * c * c), 1.0);
}

struct SmithBeckmannG1 {
  static constexpr const char* name = "g1_smith_beckmann";
  static constexpr std::array arguments{"cos_theta", "sin_theta", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta, const G& sin_theta, const T& alpha) {
    return walter_beckmann_g1(walter_beckmann_constants, cos_theta / max(alpha * sin_theta, smallest_base));
  }
};

struct SmithBeckmannMasking {
  static constexpr const char* name = "g_smith_beckmann";
  static constexpr const char* title = "Smith geometry term of Beckmann facets, rational";
  static constexpr const char* source = "Walter et al. 2007, Microfacet Models for Refraction, section 5.1; Karis 2013";
  static constexpr const char* doc = "Product of Walter's rational fits to the exact G1.";
  static constexpr std::array arguments{"cos_theta_i", "sin_theta_i", "cos_theta_o", "sin_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& sin_theta_i, const G& cos_theta_o,
                                    const G& sin_theta_o, const T& alpha) {
    return call<SmithBeckmannG1>(cos_theta_i, sin_theta_i, alpha) *
           call<SmithBeckmannG1>(cos_theta_o, sin_theta_o, alpha);
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<SmithBeckmannMasking>(g.cos_theta_i, g.sin_theta_i, g.cos_theta_o, g.sin_theta_o, alpha);
  }
};

/// √(α² sin² θ + cos² θ): how long a direction is on the surface stretched to alpha = 1. Smith's GGX functions are made
/// of it: G1 = 2 cos θ/(cos θ + length), Λ = ½ (length/cos θ - 1).
struct StretchedLength {
  static constexpr const char* name = "stretched_length";
  static constexpr std::array arguments{"cos_theta", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta, const T& alpha) {
    const auto alpha2 = let("alpha2", alpha * alpha);
    return sqrt(alpha2 + (1.0 - alpha2) * square(cos_theta));
  }
};

struct SmithGgxMasking {
  static constexpr const char* name = "g_smith_ggx";
  static constexpr const char* title = "Smith geometry term of GGX facets, uncorrelated";
  static constexpr const char* source = "Walter et al. 2007, Microfacet Models for Refraction; Karis 2013";
  static constexpr const char* doc = "Product of the exact G1 of light and view.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const T& alpha) {
    return 2.0 * cos_theta_i / (cos_theta_i + call<StretchedLength>(cos_theta_i, alpha)) *
           (2.0 * cos_theta_o / (cos_theta_o + call<StretchedLength>(cos_theta_o, alpha)));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<SmithGgxMasking>(g.cos_theta_i, g.cos_theta_o, alpha);
  }
};

/// cos θ/(cos θ (1 - k) + k).
struct SchlickG1 {
  static constexpr const char* name = "g1_schlick";
  static constexpr std::array arguments{"cos_theta", "k"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta, const T& k) {
    return cos_theta / (cos_theta * (1.0 - k) + k);
  }
};

struct SchlickBeckmannMasking {
  static constexpr const char* name = "g_schlick_beckmann";
  static constexpr const char* title = "Schlick's geometry term for Beckmann facets";
  static constexpr const char* source = "Schlick 1994; Karis 2013 (k = alpha sqrt(2/pi))";
  // Hoffman's warning in Karis 2013.
  static constexpr const char* doc = "Approximates a Smith function that is not Beckmann's own.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const T& alpha) {
    constexpr double root_two_over_pi = 0.79788456080286536;
    const auto k = let("k", root_two_over_pi * alpha);
    return call<SchlickG1>(cos_theta_i, k) * call<SchlickG1>(cos_theta_o, k);
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<SchlickBeckmannMasking>(g.cos_theta_i, g.cos_theta_o, alpha);
  }
};

struct SchlickGgxMasking {
  static constexpr const char* name = "g_schlick_ggx";
  static constexpr const char* title = "Schlick's geometry term for GGX facets";
  static constexpr const char* source = "Karis 2013, Real Shading in Unreal Engine 4 (k = alpha/2)";
  static constexpr const char* doc = "Schlick's form with k matched to GGX: exact at alpha = 1.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const T& alpha) {
    const auto k = let("k", 0.5 * alpha);
    return call<SchlickG1>(cos_theta_i, k) * call<SchlickG1>(cos_theta_o, k);
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<SchlickGgxMasking>(g.cos_theta_i, g.cos_theta_o, alpha);
  }
};

/// G/(4 N·L N·V) of the height-correlated Smith function, from both stretched lengths.
struct SmithGgxVisibility {
  static constexpr const char* name = "vis_smith_ggx";
  static constexpr std::array arguments{"cos_theta_i", "length_i", "cos_theta_o", "length_o"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const T& length_i, const G& cos_theta_o, const T& length_o) {
    return 0.5 / max(cos_theta_o * length_i + cos_theta_i * length_o, smallest_visibility_denominator);
  }
};

struct SmithGgxCorrelatedMasking {
  static constexpr const char* name = "g_smith_ggx_correlated";
  static constexpr const char* title = "Smith geometry term of GGX facets, height-correlated";
  static constexpr const char* source = "Heitz 2014, Understanding the Masking-Shadowing Function, equation 99";
  static constexpr const char* doc = "1/(1 + Lambda_i + Lambda_o): what is high is seen by both.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const T& alpha) {
    return 4.0 * cos_theta_i * cos_theta_o *
           call<SmithGgxVisibility>(cos_theta_i, call<StretchedLength>(cos_theta_i, alpha), cos_theta_o,
                                    call<StretchedLength>(cos_theta_o, alpha));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<SmithGgxCorrelatedMasking>(g.cos_theta_i, g.cos_theta_o, alpha);
  }
};

struct SmithJointApproximation {
  static constexpr const char* name = "vis_smith_joint_approx";
  static constexpr const char* title = "Unreal's approximate joint Smith visibility";
  static constexpr const char* source = "Unreal Engine 4, Vis_SmithJointApprox (S4); Hammon 2017";
  static constexpr const char* doc = "Correlated Smith over 4 N·L N·V, its roots made linear.";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const T& alpha) {
    const auto view = cos_theta_i * (cos_theta_o * (1.0 - alpha) + alpha);
    const auto light = cos_theta_o * (cos_theta_i * (1.0 - alpha) + alpha);
    return 0.5 / max(view + light, smallest_visibility_denominator);
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<SmithJointApproximation>(g.cos_theta_i, g.cos_theta_o, alpha);
  }
};

struct ClothVisibility {
  static constexpr const char* name = "vis_cloth";
  static constexpr const char* title = "Cloth visibility";
  // S4 calls it G_Cloth, but the denominator 4 N·L N·V is in it.
  static constexpr const char* source = "Neubelt, Pettineo 2013, Crafting a Next-Gen Material Pipeline; S4's G_Cloth";
  static constexpr const char* doc = "1/(4 (N·L + N·V - N·L N·V)).";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o) {
    return 0.25 / max(cos_theta_o + cos_theta_i - cos_theta_o * cos_theta_i, smallest_visibility_denominator);
  }
  template <class G>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g) {
    return call<ClothVisibility>(g.cos_theta_i, g.cos_theta_o);
  }
};

}  // namespace lobefit
