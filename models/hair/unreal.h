// Unreal Engine's hair (S3), with every constant that was fitted a parameter.
#pragma once

#include "models/hair/absorption.h"
#include "models/hair/fibre.h"
#include "models/hair/unreal_fits.h"
#include "models/hair/unreal_lobes.h"
#include "models/model.h"

namespace lobefit {

/// S = Σ M N over R, TT and TRT, each factor an approximation of d'Eon's. S3's text and code, and where they differ:
///
/// - R's tilt and width. The text subtracts α_R = -2 shift like the others' and has one width β; the code moves R by
///   2 sin α_R (cos α_R cos(φ/2) cosθ_v + sin α_R sinθ_v), twice as far at φ = 0, and scales the width by
///   √2 cos(φ/2) where bUseSeparableR is on (it is by default), which is d'Eon 2014's *non*-separable lobe: the flag's
///   name says the opposite. `r_form` offers all three.
/// - Widths. The text's Gaussian has β_n before and β_p inside the exponent; one width is meant, as in the code. The
/// code
///   calls `Theta` what is a difference of sines.
/// - η' ≈ 1.19/cosθ_d + .36 cosθ_d was fitted at η = 1.55. `ior` moves Fresnel's F0 alone: at another index the two
///   constants want refitting.
/// - h_TT. The text closes a bracket too late; the code's cos(φ/2) (1 + a (.6 - .8 cos φ)) is meant.
/// - TT's absorption. Text and legacy code have C^(√(1 - h²a²)/(2 cosθ_d)): a length that grows with 1/cosθ_d, outside
///   the fibre, where geometry has 1/cosθ_t. The other branch has exp(-2σ |1 - (ha)²/cosθ_d|), σ by Chiang's map: a
///   bracket is lost, for 1 - (ha)² = cos²γ_t is the chord's part, and what is coded lets light through unattenuated at
///   h = 0 … where (ha)² = cosθ_d. `absorption_form` offers it as coded and with the bracket.
/// - TRT's T^2 keeps the legacy form, C^(.8/cosθ_d), in either branch. h_TRT = √3/2 enters F alone, by its cosine ½.
/// - cos φ = t/√(cos²θ_l cos²θ_v + 1e-4) in the code: the softening bends it within 6° of either end of the axis (cos φ
///   10 % low where cosθ_l cosθ_v = .02), and keeps cos(φ/2) off 0.
///
/// The multiple-scattering term is S3's KajiyaKayDiffuseAttenuation under an unshadowed light, where ScatterTint is 1;
/// its weight `scatter` is GBuffer.Metallic. EvaluateHairMultipleScattering does nothing without its volume (1, 0, 1),
/// and the area light's Area is 0.
struct HairUnreal {
  static constexpr ModelInfo info{
      .name = "hair_unreal",
      .title = "Unreal Engine's hair",
      .source = "Unreal Engine 4, HairBsdf.ush, HairShading (S3); Karis 2016, Physically Based Hair Shading in Unreal",
      .kind = ModelKind::hair,
      .reciprocal = false,
      .energy_conserving = false,
      .doc =
          "R, TT and TRT by fitted closed forms, and an optional diffuse term. z is the fibre's axis; the value is S: "
          "radiance = ∫ S L dω, without cosine."};

  static constexpr std::array<std::string_view, 3> r_forms{"azimuthal_width", "constant_width", "printed"};
  static constexpr std::array<std::string_view, 3> absorption_forms{"legacy", "chiang_as_coded", "chiang"};

  template <class T>
  struct Parameters {
    Vec3<T> base_color;
    T roughness, specular, scatter, backlit;
    T ior, shift;
    T width_r, width_tt, width_trt;
    T tilt_r, tilt_tt, tilt_trt;
    T r_form, absorption_form, absorption_roughness;
    T eta_prime_inverse, eta_prime_cosine;
    T tt_offset_constant, tt_offset_cosine;
    T tt_azimuth_cosine, tt_azimuth_constant;
    T tt_absorption;
    T trt_azimuth_cosine, trt_azimuth_constant;
    T trt_absorption, trt_cosine;
    T scatter_wrap, scatter_kajiya;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.base_color, hair_base_color_parameter);
    visit(p.roughness, hair_roughness_parameter);
    const auto pin = [&](auto& member, std::string_view name, std::string_view symbol, double initial,
                         std::string_view doc) {
      visit(member, ParameterInfo{.name = name, .symbol = symbol, .initial = initial, .doc = doc});
    };
    pin(p.specular, "specular", "s", 0.5, "Weight of R over 2: the pin's neutral value is 1/2.");
    pin(p.scatter, "scatter", "m", 0.0, "Weight of the diffuse term for light scattered by other fibres.");
    pin(p.backlit, "backlit", "b", 1.0, "Weight of TT, and of R towards the light's far side.");
    visit(p.ior, hair_ior_parameter);
    visit(p.shift, hair_shift_parameter);
    describe_hair_lobes(p, visit);
    const auto choice = [&](auto& member, std::string_view name, std::span<const std::string_view> choices,
                            std::string_view doc) {
      visit(member, ParameterInfo{.name = name,
                                  .upper = static_cast<double>(choices.size() - 1),
                                  .tier = Tier::advanced,
                                  .doc = doc,
                                  .choices = choices});
    };
    choice(p.r_form, "r_form", r_forms,
           "azimuthal_width: the code with bUseSeparableR; constant_width: without; printed: S3's text, moved by the "
           "tilt itself.");
    choice(p.absorption_form, "absorption_form", absorption_forms,
           "legacy: a power of the colour; chiang_as_coded: with HairColorToAbsorption; chiang: its bracket closed.");
    const auto constant = [&](auto& member, std::string_view name, std::string_view symbol, double lower, double upper,
                              double initial, std::string_view doc) {
      visit(member, ParameterInfo{.name = name,
                                  .symbol = symbol,
                                  .lower = lower,
                                  .upper = upper,
                                  .initial = initial,
                                  .tier = Tier::full,
                                  .doc = doc});
    };
    constant(p.absorption_roughness, "absorption_roughness", "b", 0.0, 1.0, 0.3,
             "Azimuthal roughness in Chiang's map from colour to absorption.");
    constant(p.eta_prime_inverse, "eta_prime_inverse", "c_1", 0.1, 3.0, 1.19, "η' = c_1/cosθ_d + c_2 cosθ_d.");
    constant(p.eta_prime_cosine, "eta_prime_cosine", "c_2", 0.0, 3.0, 0.36, "η' = c_1/cosθ_d + c_2 cosθ_d.");
    constant(p.tt_offset_constant, "tt_offset_constant", "h_0", 0.0, 2.0, 0.6,
             "h_TT = cos(φ/2) (1 + (h_0 - h_1 cosφ)/η').");
    constant(p.tt_offset_cosine, "tt_offset_cosine", "h_1", 0.0, 2.0, 0.8,
             "h_TT = cos(φ/2) (1 + (h_0 - h_1 cosφ)/η').");
    constant(p.tt_azimuth_cosine, "tt_azimuth_cosine", "d_1", 0.0, 10.0, 3.65, "D_TT = exp(-d_1 cosφ - d_0).");
    constant(p.tt_azimuth_constant, "tt_azimuth_constant", "d_0", 0.0, 10.0, 3.98, "D_TT = exp(-d_1 cosφ - d_0).");
    constant(p.tt_absorption, "tt_absorption", "t_TT", 0.0, 2.0, 0.5,
             "Exponent of the colour in the legacy T_TT, over √(1 - h²/η'²)/cosθ_d.");
    constant(p.trt_azimuth_cosine, "trt_azimuth_cosine", "e_1", 0.0, 30.0, 17.0, "D_TRT = exp(e_1 cosφ - e_0).");
    constant(p.trt_azimuth_constant, "trt_azimuth_constant", "e_0", 0.0, 30.0, 16.78, "D_TRT = exp(e_1 cosφ - e_0).");
    constant(p.trt_absorption, "trt_absorption", "t_TRT", 0.0, 2.0, 0.8,
             "Exponent of the colour in T_TRT, over 1/cosθ_d.");
    constant(p.trt_cosine, "trt_cosine", "g", 0.0, 1.0, 0.5,
             "√(1 - h²) of the TRT ray, in its Fresnel term: ½ is h = √3/2.");
    constant(p.scatter_wrap, "scatter_wrap", "w", 0.0, 1.0, 1.0, "How far the diffuse term wraps around.");
    constant(p.scatter_kajiya, "scatter_kajiya", "k", 0.0, 1.0, 0.33,
             "Share of the diffuse term that is Kajiya and Kay's, 1 - |sinθ_l|.");
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    // Not const: see make_geometry().
    Inclinations<G> inclinations = make_inclinations(g);
    Azimuth<G> azimuth = make_azimuth<true>(g);
    const G sin_theta_v = inclinations.sin_theta_v;
    const G sines = let("sines", inclinations.sin_theta_l + sin_theta_v);
    const G cos_theta_d = inclinations.cos_theta_d;
    const G cos_phi = azimuth.cos_phi;
    const G cos_half_phi = azimuth.cos_half_phi;
    const T width = let("width", p.roughness * p.roughness);
    const T f0 = let("f0", normal_reflectance(p.ior));

    // R. Where its width is √2 cos(φ/2) times β, that goes out of ¼ cos(φ/2) Hair_g(β √2 cos(φ/2), x).
    const T alpha = let("alpha_r", p.tilt_r * p.shift);
    const T sin_alpha = let("sin_alpha", call<SmallSine>(alpha));
    const T cos_alpha = let("cos_alpha", sqrt(1.0 - sin_alpha * sin_alpha));
    const T mirrored = let(
        "mirrored", 2.0 * sin_alpha * (cos_alpha * cos_half_phi * inclinations.cos_theta_v + sin_alpha * sin_theta_v));
    const T x = let("x", sines - select(p.r_form < 1.5, mirrored, alpha));
    const T scale = let("scale", select(p.r_form < 0.5, T(std::numbers::sqrt2 * cos_half_phi), T(1.0)));
    const T n_r = let("n_r", 0.25 * select(p.r_form < 0.5, T(0.5 * std::numbers::sqrt2), T(cos_half_phi)));
    Vec3<G> sum = g.wi + g.wo;
    const G half_vector_cosine = let("half_vector_cosine", 0.5 * sqrt(dot(sum, sum)));
    const T f_r = let("f_r", call<HairSchlick>(half_vector_cosine, f0));
    const T r = let("r", call<HairGaussian>(p.width_r * width, x / scale) * n_r * f_r * (2.0 * p.specular) *
                             lerp(1.0, p.backlit, saturate(-g.cos_light_view)));

    // TT
    const T a = let("a", hair_inverse_index_fit(p.eta_prime_inverse, p.eta_prime_cosine, cos_theta_d));
    const T h = let("h", hair_tt_offset_fit(p.tt_offset_constant, p.tt_offset_cosine, a, cos_phi, cos_half_phi));
    const T enters_tt = let("enters_tt", call<SchlickTransmittance>(cos_theta_d * sqrt(1.0 - min(h * h, 1.0)), f0));
    const T inner = let("inner", h * h * (a * a));  // sin²γ_t
    const T d_b = let("d_b", call<ChiangAbsorptionScale>(p.absorption_roughness));
    const T length = let("chord", select(p.absorption_form < 1.5, hair_tt_chord_as_coded(inner, cos_theta_d),
                                         hair_tt_chord(inner, cos_theta_d)));
    const auto legacy = p.absorption_form < 0.5;
    const T linear =
        let("linear_part",
            select(legacy, T(hair_tt_exponent_fit(p.tt_absorption, T(sqrt(1.0 - inner)), cos_theta_d)), T(0.0)));
    const T quadratic = let("quadratic_part", select(legacy, T(0.0), 2.0 * length / (d_b * d_b)));
    Vec3<T> t_tt = let("t_tt", call<HairTransmittance>(p.base_color, linear, quadratic));
    const T n_tt = let("n_tt", hair_azimuth_fit(T(-p.tt_azimuth_cosine), p.tt_azimuth_constant, cos_phi));
    const T tt = let("tt", call<HairGaussian>(p.width_tt * width, sines - p.tilt_tt * p.shift) *
                               (n_tt * square(enters_tt) * p.backlit));

    // TRT
    const T fresnel_trt = let("fresnel_trt", hair_trt_fresnel_fit(p.trt_cosine, cos_theta_d, f0));
    Vec3<T> t_trt =
        let("t_trt", call<HairColorPower>(p.base_color, T(hair_trt_exponent_fit(p.trt_absorption, cos_theta_d))));
    const T n_trt = let("n_trt", hair_azimuth_fit(p.trt_azimuth_cosine, p.trt_azimuth_constant, cos_phi));
    const T trt =
        let("trt", call<HairGaussian>(p.width_trt * width, sines - p.tilt_trt * p.shift) * (n_trt * fresnel_trt));

    // Kajiya and Kay's diffuse term, and a Lambertian one about the normal that faces the view.
    const G facing = let("facing", g.tangential_dot / max(inclinations.cos_theta_v, smallest_base));
    const T wrapped = let("wrapped", saturate((facing + p.scatter_wrap) / square(1.0 + p.scatter_wrap)));
    const T diffuse = let("diffuse", lerp(wrapped, T(1.0 - abs(inclinations.sin_theta_l)), p.scatter_kajiya) / pi);
    Vec3<T> scattered = call<HairColorPower>(p.base_color, T(0.5)) * (p.scatter * diffuse);

    return t_tt * tt + t_trt * trt + scattered + r;
  }

  /// Over the whole sphere, lobe by lobe.
  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return HairUnrealLobes(p, wo).sample(u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return HairUnrealLobes(p, wo).pdf(wi);
  }
};

}  // namespace lobefit
