// Distributions of facet normals as model texts: D in 1/sr, normalised so that ∫ D cos θ_h dω_h = 1.
//
// At alpha = .002 the lobe lives where cos θ_h rounds to 1 in float, so the texts take sin² θ_h, which Geometry makes
// from the tangential components. The textbook GGX, (N·H)² (α² - 1) + 1, is off by 15 % there.
//
// Sources: Karis 2013, Specular BRDF Reference, in alpha = roughness²; the cloth's as in engine sources.
#pragma once

#include "models/geometry.h"

namespace lobefit {

/// A facet below this is a mirror, which is no BRDF: lobes that take roughness from 0 keep alpha above it.
inline constexpr double smallest_alpha = 1e-4;

/// -ln(1 - x)/x for x in [0, 1), with `rest` = 1 - x from whoever has it without cancellation.
struct LogarithmRatio {
  static constexpr const char* name = "logarithm_ratio";
  static constexpr std::array arguments{"x", "rest"};

  template <class X>
  LOBEFIT_TEXT static auto evaluate(const X& x, const X& rest) {
    // -ln(1 - x) = 2 artanh y: below x = .1 the series' next term is under 4e-17.
    const auto y = let("y", x / (2.0 - x));
    const auto y2 = let("y2", y * y);
    const auto series =
        2.0 / (2.0 - x) *
        (1.0 + y2 * (1.0 / 3.0 + y2 * (1.0 / 5.0 + y2 * (1.0 / 7.0 + y2 * (1.0 / 9.0 + y2 * (1.0 / 11.0))))));
    return select(x < 0.1, series, -log(rest) / max(x, 0.1));
  }
};

struct BlinnPhongDistribution {
  static constexpr const char* name = "d_blinn_phong";
  static constexpr const char* title = "Blinn-Phong distribution";
  static constexpr const char* source = "Blinn 1977; Karis 2013, Specular BRDF Reference";
  static constexpr const char* doc = "cos^n with n = 2/alpha² - 2. Not shape invariant.";
  static constexpr std::array arguments{"cos2_theta_h", "sin2_theta_h", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos2_theta_h, const G& sin2_theta_h, const T& alpha) {
    const auto alpha2 = let("alpha2", alpha * alpha);
    // (cos²)^(1/α² - 1) by the logarithm of 1 - sin²: at α = .002 the exponent is 250,000.
    const auto fall = let("fall", sin2_theta_h * call<LogarithmRatio>(sin2_theta_h, cos2_theta_h));
    return exp(-(1.0 / alpha2 - 1.0) * fall) / (pi * alpha2);
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<BlinnPhongDistribution>(square(g.cos_theta_h), g.sin2_theta_h, alpha);
  }
};

struct BeckmannDistribution {
  static constexpr const char* name = "d_beckmann";
  static constexpr const char* title = "Beckmann distribution";
  static constexpr const char* source = "Beckmann, Spizzichino 1963; Karis 2013, Specular BRDF Reference";
  static constexpr const char* doc = "Gaussian slopes. Shape invariant.";
  static constexpr std::array arguments{"cos2_theta_h", "sin2_theta_h", "alpha"};
  /// Where cos² θ_h is kept off 0: any lobe with α ≤ 3.2 is below e^-97 there.
  static constexpr double smallest_cos2 = 1e-3;

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos2_theta_h, const G& sin2_theta_h, const T& alpha) {
    const auto alpha2 = let("alpha2", alpha * alpha);
    const auto cos2 = let("cos2", max(cos2_theta_h, smallest_cos2));
    return exp(-sin2_theta_h / (cos2 * alpha2)) / (pi * alpha2 * (cos2 * cos2));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<BeckmannDistribution>(square(g.cos_theta_h), g.sin2_theta_h, alpha);
  }
};

/// The same with a roughness along x and one along y.
struct BeckmannAnisotropicDistribution {
  static constexpr const char* name = "d_beckmann_anisotropic";
  static constexpr const char* title = "Beckmann distribution, anisotropic";
  static constexpr const char* source = "Heitz 2014, Understanding the Masking-Shadowing Function, section 5.3";
  static constexpr const char* doc = "Gaussian slopes, stretched along x and y.";
  static constexpr std::array arguments{"h", "alpha_x", "alpha_y"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const Vec3<G>& h, const T& alpha_x, const T& alpha_y) {
    const auto cos2 = let("cos2", max(square(h.z), BeckmannDistribution::smallest_cos2));
    const auto slope2 = let("slope2", (square(h.x / alpha_x) + square(h.y / alpha_y)) / cos2);
    return exp(-slope2) / (pi * alpha_x * alpha_y * (cos2 * cos2));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha_x, const T& alpha_y) {
    return call<BeckmannAnisotropicDistribution>(g.h, alpha_x, alpha_y);
  }
};

struct GgxDistribution {
  static constexpr const char* name = "d_ggx";
  static constexpr const char* title = "GGX (Trowbridge-Reitz) distribution";
  static constexpr const char* source = "Trowbridge, Reitz 1975; Walter et al. 2007; Karis 2013";
  static constexpr const char* doc = "Facets of an ellipsoid. Shape invariant.";
  static constexpr std::array arguments{"sin2_theta_h", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& sin2_theta_h, const T& alpha) {
    const auto alpha2 = let("alpha2", alpha * alpha);
    // sin² + α² cos²: a sum of what is positive.
    const auto ellipsoid = let("ellipsoid", alpha2 + (1.0 - alpha2) * sin2_theta_h);
    return alpha2 / (pi * square(ellipsoid));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<GgxDistribution>(g.sin2_theta_h, alpha);
  }
};

struct GgxAnisotropicDistribution {
  static constexpr const char* name = "d_ggx_anisotropic";
  static constexpr const char* title = "GGX distribution, anisotropic";
  static constexpr const char* source = "Burley 2012, Physically Based Shading at Disney, appendix B.2; Karis 2013";
  static constexpr const char* doc = "GGX slopes, stretched along x and y.";
  static constexpr std::array arguments{"h", "alpha_x", "alpha_y"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const Vec3<G>& h, const T& alpha_x, const T& alpha_y) {
    // At least .1 for the alphas up to 3.2 that Burley's mapping makes (2 by Kulla and Conty's); the guard matters only
    // where wi + wo is too short to be normalised.
    const auto ellipsoid = let("ellipsoid", max(square(h.x / alpha_x) + square(h.y / alpha_y) + square(h.z), 0.05));
    return 1.0 / (pi * alpha_x * alpha_y * square(ellipsoid));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha_x, const T& alpha_y) {
    return call<GgxAnisotropicDistribution>(g.h, alpha_x, alpha_y);
  }
};

/// Generalised Trowbridge-Reitz with exponent 1: Disney's clear coat. The printed normalisation (α² - 1)/(π ln α²) is
/// 0/0 at α = 1; as 1/(π LogarithmRatio) it is not.
struct Gtr1Distribution {
  static constexpr const char* name = "d_gtr1";
  static constexpr const char* title = "GTR1 distribution";
  static constexpr const char* source = "Burley 2012, Physically Based Shading at Disney, appendix B.2";
  static constexpr const char* doc = "Longer tail than GGX. Not shape invariant: no Smith function follows from it.";
  static constexpr std::array arguments{"sin2_theta_h", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& sin2_theta_h, const T& alpha) {
    const auto alpha2 = let("alpha2", alpha * alpha);
    const auto flatness = let("flatness", 1.0 - alpha2);
    return 1.0 / (pi * call<LogarithmRatio>(flatness, alpha2) * (alpha2 + flatness * sin2_theta_h));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<Gtr1Distribution>(g.sin2_theta_h, alpha);
  }
};

struct CharlieDistribution {
  static constexpr const char* name = "d_charlie";
  static constexpr const char* title = "Charlie sheen distribution";
  static constexpr const char* source = "Estevez, Kulla 2017, Production Friendly Microfacet Sheen BRDF";
  static constexpr const char* doc = "Power of the sine: fibres that stand up.";
  static constexpr std::array arguments{"cos2_theta_h", "sin2_theta_h", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos2_theta_h, const G& sin2_theta_h, const T& alpha) {
    const auto exponent = let("exponent", 1.0 / alpha);
    // sin^(1/α) by the logarithm of 1 - cos²: steep where sin θ_h is next to 1.
    const auto fall = let("fall", cos2_theta_h * call<LogarithmRatio>(cos2_theta_h, sin2_theta_h));
    return (2.0 + exponent) / (2.0 * pi) * exp(-0.5 * exponent * fall);
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<CharlieDistribution>(square(g.cos_theta_h), g.sin2_theta_h, alpha);
  }
};

struct AshikhminDistribution {
  static constexpr const char* name = "d_ashikhmin";
  static constexpr const char* title = "Ashikhmin velvet distribution";
  static constexpr const char* source = "Ashikhmin, Premoze 2007, Distribution-based BRDFs; S4's normalisation";
  static constexpr const char* doc = "Inverted Gaussian over a constant.";
  static constexpr std::array arguments{"cos2_theta_h", "sin2_theta_h", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos2_theta_h, const G& sin2_theta_h, const T& alpha) {
    const auto alpha2 = let("alpha2", alpha * alpha);
    // cot² is a pole at N·H = 1, where the exponential is long 0: below this sine it is under e^-998.
    const auto sin2 = let("sin2", max(sin2_theta_h, 1e-3));
    const auto rim = let("rim", exp(-cos2_theta_h / (sin2 * alpha2)) / (sin2 * sin2));
    return (1.0 + 4.0 * rim) / (pi * (1.0 + 4.0 * alpha2));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<AshikhminDistribution>(square(g.cos_theta_h), g.sin2_theta_h, alpha);
  }
};

struct AshikhminApproximation {
  static constexpr const char* name = "d_ashikhmin_approx";
  static constexpr const char* title = "Ashikhmin velvet distribution, approximated";
  static constexpr const char* source = "Unreal Engine's D_InvGGX (S4)";
  static constexpr const char* doc = "An inverted GGX in the place of the inverted Gaussian.";
  static constexpr std::array arguments{"cos2_theta_h", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos2_theta_h, const T& alpha) {
    const auto alpha2 = let("alpha2", alpha * alpha);
    // cos² + α² sin²
    const auto ellipsoid = let("ellipsoid", alpha2 + (1.0 - alpha2) * cos2_theta_h);
    return (1.0 + 4.0 * square(alpha2 / ellipsoid)) / (pi * (1.0 + 4.0 * alpha2));
  }
  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& alpha) {
    return call<AshikhminApproximation>(square(g.cos_theta_h), alpha);
  }
};

}  // namespace lobefit
