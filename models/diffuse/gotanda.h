// Gotanda's two diffuse models for tri-Ace's engine.
#pragma once

#include "models/diffuse/one_minus_power.h"
#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

struct Gotanda2012 : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "gotanda_2012",
      .title = "Gotanda 2012 diffuse",
      .source =
          "Gotanda 2012, Beyond a Simple Physically Based Blinn-Phong Model in Real-Time, SIGGRAPH course; "
          "coefficients as in Unreal Engine's Diffuse_OrenNayar",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "Oren-Nayar's qualitative form with Fujii's lobe, alpha in the place of sigma, and a factor that gives "
          "back energy with roughness, too much of it: the albedo reaches 1.22 at the horizon."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T alpha;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.alpha, alpha_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    // σ = α as in Unreal Engine; a comment there would have α/(1.29 + α/2).
    const T s2 = let("s2", p.alpha * p.alpha);
    const G q = let("q", g.tangential_dot);
    const G lobe = let("lobe", select(q >= 0.0, q / max(max(g.cos_theta_i, g.cos_theta_o), smallest_base), q));
    const T c1 = let("c1", 1.0 - 0.5 * s2 / (s2 + 0.33));
    const T c2 = let("c2", 0.45 * s2 / (s2 + 0.09) * lobe);
    return p.albedo / pi * ((c1 + c2) * (1.0 + 0.5 * sqrt(p.alpha)));
  }
};

/// L = 21/20 (1 - F0) ρ/π [F_r L_m + V_d B_p], in whose L_m and B_p stands the cosine of the light; here it is divided
/// out.
///
/// Copies differ in the sign inside L_m: 1 + ½α (μi - 1), or Unreal Engine's 1 - ½α (μi - 1), which its own second
/// branch contradicts; and in V_d B_p, or Unreal's V_d + B_p, which leaves a smooth surface (V_d = 0) the lobe of a
/// rough one. The reference of Lambertian facets under an interface, single bounce, decides. Rms of (f - f_ref) μi π/ρ
/// over α = .1, .4, .7, 1, θ = 0, 25, 50, 75° and φ = 0, 45, … 180° (tests/diffuse_test.cpp):
///
///               1 + ½α (μi - 1)   1 - ½α (μi - 1)
///   V_d B_p          .039              .064
///   V_d + B_p        .317              .349
///
/// So `gotanda_2014` is the first. Unreal's users meet the sum: `gotanda_2014_unreal` is its branch that is a BRDF. The
/// branch compiled there has the other sign and returns L, cosine included, in the place of a BRDF.
template <class T>
struct Gotanda2014Parameters {
  Vec3<T> albedo;
  T alpha;
};

template <class P, class Visit>
constexpr void describe_gotanda_2014(P& p, Visit&& visit) {
  visit(p.albedo, albedo_parameter);
  visit(p.alpha, alpha_parameter);
}

/// 21/20 (1 - F0), F0 = .04.
inline constexpr double gotanda_2014_scale = 21.0 / 20.0 * (1.0 - 0.04);

/// F_r L_m: what enters the facets towards the light and leaves them towards the viewer.
struct Gotanda2014Base {
  static constexpr const char* name = "gotanda_2014_base";
  static constexpr std::array arguments{"alpha", "cos_theta_i", "cos_theta_o"};

  template <class T, class G>
  LOBEFIT_TEXT static auto evaluate(const T& alpha, const G& cos_theta_i, const G& cos_theta_o) {
    const T s2 = let("s2", alpha * alpha);
    const T a = let("a", s2 + 1.36053);
    const G grazing = let("grazing", 1.0 - cos_theta_o);
    const T constant = let("constant", 1.0 - (0.542026 * s2 + 0.303573 * alpha) / a);
    const T schlick = let("schlick", 1.0 - pow(grazing, 5.0 - 4.0 * s2) / a);
    const T cubic = let("cubic", ((-0.733996 * alpha + 1.50912) * alpha - 1.16402) * alpha);
    const T f_r = let("f_r", constant * schlick * (cubic * pow(grazing, 1.0 + 1.0 / (39.0 * s2 * s2 + 1.0)) + 1.0));
    const T l_m = let("l_m", (max(1.0 - 2.0 * alpha, 0.0) * (1.0 - pow5(1.0 - cos_theta_i)) + min(2.0 * alpha, 1.0)) *
                                 (1.0 - 0.5 * alpha + 0.5 * alpha * cos_theta_i));
    return f_r * l_m;
  }
};

/// V_d.
struct Gotanda2014Visibility {
  static constexpr const char* name = "gotanda_2014_visibility";
  static constexpr std::array arguments{"alpha", "cos_theta_i", "cos_theta_o"};

  template <class T, class G>
  LOBEFIT_TEXT static auto evaluate(const T& alpha, const G& cos_theta_i, const G& cos_theta_o) {
    const T s2 = let("s2", alpha * alpha);
    const G exponent =
        let("exponent", (1.0 - 0.3726732 * cos_theta_o * cos_theta_o) / (0.188566 + 0.38841 * cos_theta_o));
    return s2 / ((s2 + 0.09) * (1.31072 + 0.995584 * cos_theta_o)) * call<OneMinusPower>(cos_theta_i, exponent);
  }
};

struct Gotanda2014 : CosineSampling {
  static constexpr ModelInfo info{
      .name = "gotanda_2014",
      .title = "Gotanda 2014 diffuse",
      .source = "Gotanda 2014, Designing Reflectance Models for New Consoles, SIGGRAPH course",
      .reciprocal = false,
      .energy_conserving = true,
      .doc =
          "Fit to GGX facets that are Lambertian below a smooth interface, in the manner of Oren-Nayar; F0 = 0.04 "
          "is built in. Not reciprocal: next to the horizon light and view exchanged can differ by a factor of 200."};

  template <class T>
  using Parameters = Gotanda2014Parameters<T>;

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_gotanda_2014(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T base = let("base", call<Gotanda2014Base>(p.alpha, g.cos_theta_i, g.cos_theta_o));
    const T v_d = let("v_d", call<Gotanda2014Visibility>(p.alpha, g.cos_theta_i, g.cos_theta_o));
    const G q = let("q", g.tangential_dot);
    const G b_p = let("b_p", select(q < 0.0, 1.4 * g.cos_theta_o * q, q / max(g.cos_theta_i, smallest_base)));
    return p.albedo / pi * (gotanda_2014_scale * (base + v_d * b_p));
  }
};

struct Gotanda2014Unreal : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "gotanda_2014_unreal",
      .title = "Gotanda 2014 diffuse, Unreal Engine's copy",
      .source = "Unreal Engine 4, BRDF.ush, Diffuse_Gotanda, the branch that is divided by N.L",
      .reciprocal = false,
      .energy_conserving = false,
      .non_negative = false,
      .doc =
          "As gotanda_2014, but with V_d + B_p in the place of V_d B_p: far from Lambert when smooth, negative down "
          "to -0.22, and with an albedo of up to 1.36."};

  template <class T>
  using Parameters = Gotanda2014Parameters<T>;

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_gotanda_2014(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T base = let("base", call<Gotanda2014Base>(p.alpha, g.cos_theta_i, g.cos_theta_o));
    const T v_d = let("v_d", call<Gotanda2014Visibility>(p.alpha, g.cos_theta_i, g.cos_theta_o));
    const G q = let("q", g.tangential_dot);
    const G b_p = let("b_p", select(q < 0.0, 1.4 * g.cos_theta_o * q, q / max(g.cos_theta_i, smallest_base)));
    return p.albedo / pi * (gotanda_2014_scale * (base + v_d + b_p));
  }
};

}  // namespace lobefit
