// How much of the light a smooth interface reflects. `cosine` is that of the angle between the light and the facet's
// normal, in [0, 1].
#pragma once

#include "models/geometry.h"

namespace lobefit {

/// The reflectance at normal incidence at every angle.
struct ConstantFresnel {
  static constexpr const char* name = "f_none";
  static constexpr const char* title = "No Fresnel term";
  static constexpr const char* source = "Karis 2013, Specular BRDF Reference";
  static constexpr const char* doc = "f0 at every angle.";
  static constexpr std::array arguments{"f0"};

  template <class F>
  LOBEFIT_TEXT static constexpr auto evaluate(const F& f0) {
    return f0;
  }
  template <class G, class F0>
  LOBEFIT_TEXT static constexpr auto at(const Geometry<G>&, const F0& f0) {
    return call<ConstantFresnel>(f0);
  }
};

/// Schlick 1994, An Inexpensive BRDF Model for Physically-based Rendering, with the reflectance f90 at grazing angles.
struct SchlickFresnel {
  static constexpr const char* name = "f_schlick";
  static constexpr const char* title = "Schlick's Fresnel approximation";
  static constexpr const char* source = "Schlick 1994, An Inexpensive BRDF Model";
  static constexpr const char* doc = "From f0 at normal incidence to f90 at grazing angles by the fifth power.";
  static constexpr std::array arguments{"cosine", "f0", "f90"};

  template <class T, class F>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& cosine, const F& f0, const F& f90) {
    return f0 + (f90 - f0) * call<Pow5>(1.0 - cosine);
  }
  template <class G, class F0, class F1>
  LOBEFIT_TEXT static constexpr auto at(const Geometry<G>& g, const F0& f0, const F1& f90) {
    return call<SchlickFresnel>(g.cos_theta_d, f0, f90);
  }
};

/// 1 - Schlick's reflectance for f90 = 1, which would cancel where next to nothing enters: 1 - (1 - c)⁵ is c times a
/// polynomial.
struct SchlickTransmittance {
  static constexpr const char* name = "one_minus_f_schlick";
  static constexpr std::array arguments{"cosine", "f0"};

  template <class T, class F>
  LOBEFIT_TEXT static auto evaluate(const T& cosine, const F& f0) {
    return (1.0 - f0) * (cosine * (5.0 - cosine * (10.0 - cosine * (10.0 - cosine * (5.0 - cosine)))));
  }
};

/// Fresnel's equations between two dielectrics, unpolarised. `eta`: the index beyond the interface over the index on
/// the light's side. Past the critical angle the guarded root vanishes and the result is 1.
struct DielectricFresnel {
  static constexpr const char* name = "f_dielectric";
  static constexpr const char* title = "Fresnel equations between dielectrics";
  static constexpr const char* source = "Fresnel 1823; Born, Wolf, Principles of Optics";
  static constexpr const char* doc = "Exact, unpolarised; total reflection beyond the critical angle.";
  static constexpr std::array arguments{"cosine", "eta"};

  template <class T, class E>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& cosine, const E& eta) {
    // Kept off 0, where both quotients would be 0/0 beyond the critical angle.
    const auto c = max(cosine, smallest_base);
    const auto eta2 = eta * eta;
    const auto g = sqrt(eta2 - 1.0 + c * c);  // eta times the cosine of the refracted ray
    const auto s = (c - g) / (c + g);
    const auto p = (eta2 * c - g) / (eta2 * c + g);
    return 0.5 * (s * s + p * p);
  }
  template <class G, class E0>
  LOBEFIT_TEXT static constexpr auto at(const Geometry<G>& g, const E0& eta) {
    return call<DielectricFresnel>(g.cos_theta_d, eta);
  }
};

/// Fresnel's equations for a medium of complex index eta + i k over the index on the light's side, unpolarised (Born,
/// Wolf, Principles of Optics, section 14.2, with the refraction angle eliminated).
struct ConductorFresnel {
  static constexpr const char* name = "f_conductor";
  static constexpr const char* title = "Fresnel equations of a conductor";
  static constexpr const char* source = "Born, Wolf, Principles of Optics, section 14.2";
  static constexpr const char* doc = "Exact, unpolarised, for the complex index eta + i k.";
  static constexpr std::array arguments{"cosine", "eta", "k"};

  template <class T, class E>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& cosine, const E& eta, const E& k) {
    const auto cos2 = cosine * cosine;
    const auto sin2 = 1.0 - cos2;
    const auto difference = eta * eta - k * k - sin2;
    const auto modulus = sqrt(difference * difference + 4.0 * eta * eta * (k * k));  // a² + b²
    const auto twice_a_cosine = 2.0 * cosine * sqrt(0.5 * (modulus + difference));
    const auto s = (modulus + cos2 - twice_a_cosine) / (modulus + cos2 + twice_a_cosine);
    const auto even = cos2 * modulus + sin2 * sin2;
    const auto odd = twice_a_cosine * sin2;
    return 0.5 * s * (1.0 + (even - odd) / (even + odd));
  }
  template <class G, class E0, class K1>
  LOBEFIT_TEXT static constexpr auto at(const Geometry<G>& g, const E0& eta, const K1& k) {
    return call<ConductorFresnel>(g.cos_theta_d, eta, k);
  }
};

/// Cook, Torrance 1982: the dielectric whose reflectance at normal incidence is f0, by η = (1 + √f0)/(1 - √f0).
///
/// The printed form has a pole in η at f0 = 1, and its g = √(η² + c² - 1) cancels at f0 = 0. Multiplied by
/// q = 1 - √f0 it has neither: with G = q g = √(4√f0 + q² c²) its first factor is ((g - c)/(g + c))² =
/// (4√f0/(G + q c)²)², its second ((G c - q s²)/(G c + q s²))², s² = 1 - c².
struct CookTorranceFresnel {
  static constexpr const char* name = "f_cook_torrance";
  static constexpr const char* title = "Cook and Torrance's Fresnel term";
  static constexpr const char* source = "Cook, Torrance 1982; Karis 2013";
  static constexpr const char* doc = "The dielectric that reflects f0 at normal incidence.";
  static constexpr std::array arguments{"cosine", "f0"};

  template <class T, class F>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& cosine, const F& f0) {
    const auto root = let("root", sqrt(f0));
    const auto q = let("q", 1.0 - root);
    // Kept off 0, where the second factor is 0/0 at f0 = 1 and the first at f0 = 0.
    const auto c = let("c", max(cosine, 1e-15));
    const auto g = let("g", sqrt(4.0 * root + square(q * c)));
    const auto first = let("first", 4.0 * root / square(g + q * c));
    const auto across = let("across", q * (1.0 - c * c));
    const auto second = let("second", (g * c - across) / (g * c + across));
    return 0.5 * square(first) * (1.0 + square(second));
  }
  template <class G, class F0>
  LOBEFIT_TEXT static constexpr auto at(const Geometry<G>& g, const F0& f0) {
    return call<CookTorranceFresnel>(g.cos_theta_d, f0);
  }
};

/// Callisto's Schlick with a falloff n_s (S0): F = f0 + t(2 - r) (1 - f0) (1 - cos)^(5 r), r = 2 (1 - n_s), t = clamp
/// to [0, 1]. Schlick at n_s = ½; 1 at every angle at n_s = 1; f0 at n_s = 0.
struct CallistoFresnel {
  static constexpr const char* name = "f_callisto";
  static constexpr const char* title = "Callisto's Fresnel term";
  static constexpr const char* source = "Jimenez et al. 2023, The Character Rendering Art of The Callisto Protocol";
  static constexpr const char* doc = "Schlick with a falloff: constant, Schlick and 1 at n_s = 0, 1/2 and 1.";
  static constexpr std::array arguments{"one_minus_cosine", "f0", "falloff"};

  template <class T, class F, class N>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& one_minus_cosine, const F& f0, const N& falloff) {
    // 2 - r = 2 n_s
    return f0 + (1.0 - f0) * (saturate(2.0 * falloff) * pow(one_minus_cosine, 10.0 * (1.0 - falloff)));
  }
  template <class G, class F0, class F1>
  LOBEFIT_TEXT static constexpr auto at(const Geometry<G>& g, const F0& f0, const F1& falloff) {
    return call<CallistoFresnel>(one_minus_cosine(g.sin2_theta_d, g.cos_theta_d), f0, falloff);
  }
};

/// Unreal's Schlick: an f0 whose `shadowing` (green channel) is below 2 % means shadow, and loses its grazing
/// reflection too (S4).
struct UnrealFresnel {
  static constexpr const char* name = "f_unreal";
  static constexpr const char* title = "Unreal's Schlick";
  static constexpr const char* source = "Unreal Engine 4, F_Schlick (S4)";
  static constexpr const char* doc = "Schlick whose grazing reflection goes out for f0 below 2 %.";
  static constexpr std::array arguments{"cosine", "f0", "shadowing"};

  template <class T, class F, class S>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& cosine, const F& f0, const S& shadowing) {
    const auto grazing = let("grazing", call<Pow5>(1.0 - cosine));
    return saturate(50.0 * shadowing) * grazing + (1.0 - grazing) * f0;
  }
  template <class G, class F0>
  LOBEFIT_TEXT static constexpr auto at(const Geometry<G>& g, const F0& f0) {
    return call<UnrealFresnel>(g.cos_theta_d, f0, f0);
  }
};

}  // namespace lobefit
