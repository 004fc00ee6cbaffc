// The exact forms that Unreal's hair approximates, and its approximations (S3), as registered terms of a fibre.
//
// A pair `hair_X`, `hair_X_fit` is a formula and Unreal's fit to it, whose constants are parameters. What a fit takes
// as given (η', h) is exact in both, so that their difference is the fit's own error.
#pragma once

#include "models/hair/longitudinal.h"
#include "models/hair/unreal_fits.h"
#include "models/specular/term.h"

namespace lobefit {

/// What all terms here say of themselves.
struct HairTermText {
  static constexpr ModelKind kind = ModelKind::hair_term;
  static constexpr const char* source = "Unreal Engine 4, hair shading (S3)";
  static constexpr const char* exact_source = "d'Eon et al. 2011; Marschner et al. 2003 (S3)";
};

/// |h_TT|, exactly: cos(φ/2)/√(1 + a² - 2a sin(φ/2)), a = 1/η'. The radicand as (1 - a sin)² + a² cos², which does
/// not cancel. It belongs to a TT ray only where φ ≥ 2 asin a; S3 does not say so.
template <class A, class G>
LOBEFIT_TEXT auto exact_tt_offset(const A& a, const Azimuth<G>& azimuth) {
  const auto along = 1.0 - a * azimuth.sin_half_phi;
  const auto across = a * azimuth.cos_half_phi;
  return azimuth.cos_half_phi / sqrt(along * along + across * across);
}

struct EtaPrimeText : HairTermText {
  static constexpr const char* name = "hair_eta_prime";
  static constexpr const char* title = "Bravais index of a fibre";
  static constexpr const char* source = exact_source;
  static constexpr const char* doc = "η' = √(η² - sin²θ_d)/cosθ_d.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& ior) {
    Inclinations<G> inclinations = make_inclinations(g);
    return 1.0 / inverse_bravais_index(ior, inclinations.cos_theta_d);
  }
};

struct EtaPrimeFitText : HairTermText {
  static constexpr const char* name = "hair_eta_prime_fit";
  static constexpr const char* title = "Unreal's fit of the Bravais index";
  static constexpr const char* doc = "c_1/cosθ_d + c_2 cosθ_d, for an index of 1.55: up to .675 % off.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& inverse, const T& cosine) {
    Inclinations<G> inclinations = make_inclinations(g);
    return hair_index_fit(inverse, cosine, inclinations.cos_theta_d);
  }
};

struct TtOffsetText : HairTermText {
  static constexpr const char* name = "hair_h_tt";
  static constexpr const char* title = "Where the TT ray meets the fibre";
  static constexpr const char* source = exact_source;
  static constexpr const char* doc = "|h| = cos(φ/2)/√(1 + a² - 2a sin(φ/2)), a = 1/η'; a ray's where φ ≥ 2 asin a.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& ior) {
    Inclinations<G> inclinations = make_inclinations(g);
    Azimuth<G> azimuth = make_azimuth<false>(g);
    return exact_tt_offset(inverse_bravais_index(ior, inclinations.cos_theta_d), azimuth);
  }
};

struct TtOffsetFitText : HairTermText {
  static constexpr const char* name = "hair_h_tt_fit";
  static constexpr const char* title = "Unreal's fit of the TT offset";
  static constexpr const char* doc = "|cos(φ/2) (1 + a (h_0 - h_1 cosφ))|, a = 1/η' exact.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& ior, const T& constant, const T& cosine) {
    Inclinations<G> inclinations = make_inclinations(g);
    Azimuth<G> azimuth = make_azimuth<false>(g);
    const auto a = inverse_bravais_index(ior, inclinations.cos_theta_d);
    // |h| as above: at other constants it may change its sign, and only h² enters a shading.
    return abs(hair_tt_offset_fit(constant, cosine, a, azimuth.cos_phi, azimuth.cos_half_phi));
  }
};

/// D(x, s) = e^(-x/s)/(s (1 + e^(-x/s))²), x ≥ 0.
struct LogisticDensity {
  static constexpr const char* name = "logistic_density";
  static constexpr std::array arguments{"x", "scale"};

  template <class X, class S>
  LOBEFIT_TEXT static auto evaluate(const X& x, const S& scale) {
    const auto e = let("e", exp(-x / scale));
    return e / (scale * ((1.0 + e) * (1.0 + e)));
  }
};

struct TtAzimuthText : HairTermText {
  static constexpr const char* name = "hair_d_tt";
  static constexpr const char* title = "Azimuthal distribution of TT";
  static constexpr const char* doc = "The logistic density of φ about 180°, unwrapped: D(φ, .35, π).";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& scale) {
    Azimuth<G> azimuth = make_azimuth<false>(g);
    return call<LogisticDensity>(pi - azimuth_angle(azimuth), scale);
  }
};

struct TtAzimuthFitText : HairTermText {
  static constexpr const char* name = "hair_d_tt_fit";
  static constexpr const char* title = "Unreal's fit of the azimuthal distribution of TT";
  static constexpr const char* doc = "exp(-d_1 cosφ - d_0).";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& cosine, const T& constant) {
    Azimuth<G> azimuth = make_azimuth<false>(g);
    return hair_azimuth_fit(T(-cosine), constant, azimuth.cos_phi);
  }
};

struct TrtAzimuthText : HairTermText {
  static constexpr const char* name = "hair_d_trt";
  static constexpr const char* title = "Azimuthal distribution of TRT";
  static constexpr const char* doc = "A share of the logistic density of φ about 0, unwrapped: 3/4 D(φ, .15, 0).";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& scale, const T& share) {
    Azimuth<G> azimuth = make_azimuth<false>(g);
    return share * call<LogisticDensity>(azimuth_angle(azimuth), scale);
  }
};

struct TrtAzimuthFitText : HairTermText {
  static constexpr const char* name = "hair_d_trt_fit";
  static constexpr const char* title = "Unreal's fit of the azimuthal distribution of TRT";
  static constexpr const char* doc = "exp(e_1 cosφ - e_0).";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& cosine, const T& constant) {
    Azimuth<G> azimuth = make_azimuth<false>(g);
    return hair_azimuth_fit(cosine, constant, azimuth.cos_phi);
  }
};

/// cosγ_t = √(1 - h²a²) and cosθ_t = √(1 - sin²θ_d/η²).
template <class T>
struct InnerCosines {
  T gamma, theta;
};
template <class T, class H, class G>
LOBEFIT_TEXT InnerCosines<T> inner_cosines(const T& ior, const H& h, const G& cos_theta_d) {
  const T offset = h * inverse_bravais_index(ior, cos_theta_d);
  // η² cos²θ_t = η² - 1 + cos²θ_d
  return {T(sqrt(1.0 - offset * offset)), T(sqrt((ior - 1.0) * (ior + 1.0) + cos_theta_d * cos_theta_d) / ior)};
}

/// One traversal: exp(-2μ cosγ_t/cosθ_t) with μ = -¼ ln C.
struct TtTransmittanceText : HairTermText {
  static constexpr const char* name = "hair_t_tt";
  static constexpr const char* title = "Transmittance of TT";
  static constexpr const char* source = exact_source;
  static constexpr const char* doc = "C^(½ cosγ_t/cosθ_t) at the exact offset: absorption along the ray's length.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& color, const T& ior) {
    Inclinations<G> inclinations = make_inclinations(g);
    Azimuth<G> azimuth = make_azimuth<false>(g);
    const T a = inverse_bravais_index(ior, inclinations.cos_theta_d);
    InnerCosines<T> inner = inner_cosines(ior, T(exact_tt_offset(a, azimuth)), inclinations.cos_theta_d);
    return pow(color, 0.5 * inner.gamma / inner.theta);
  }
};

/// As S3's text prints it: exp(-2μ (1 + cos 2γ_t)/cosθ_t) = exp(-4μ cos²γ_t/cosθ_t), which is no length.
struct TtTransmittancePrintedText : HairTermText {
  static constexpr const char* name = "hair_t_tt_printed";
  static constexpr const char* title = "Transmittance of TT as S3's text prints it";
  static constexpr const char* source = exact_source;
  static constexpr const char* doc = "C^(cos²γ_t/cosθ_t) at the exact offset: not along a length.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& color, const T& ior) {
    Inclinations<G> inclinations = make_inclinations(g);
    Azimuth<G> azimuth = make_azimuth<false>(g);
    const T a = inverse_bravais_index(ior, inclinations.cos_theta_d);
    InnerCosines<T> inner = inner_cosines(ior, T(exact_tt_offset(a, azimuth)), inclinations.cos_theta_d);
    return pow(color, inner.gamma * inner.gamma / inner.theta);
  }
};

struct TtTransmittanceFitText : HairTermText {
  static constexpr const char* name = "hair_t_tt_fit";
  static constexpr const char* title = "Unreal's transmittance of TT";
  static constexpr const char* doc = "C^(t cosγ_t/cosθ_d) at the exact offset: θ_d stands where θ_t is meant.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& color, const T& ior, const T& exponent) {
    Inclinations<G> inclinations = make_inclinations(g);
    Azimuth<G> azimuth = make_azimuth<false>(g);
    const T a = inverse_bravais_index(ior, inclinations.cos_theta_d);
    InnerCosines<T> inner = inner_cosines(ior, T(exact_tt_offset(a, azimuth)), inclinations.cos_theta_d);
    return pow(color, hair_tt_exponent_fit(exponent, inner.gamma, inclinations.cos_theta_d));
  }
};

/// Two traversals at a given offset.
struct TrtTransmittanceText : HairTermText {
  static constexpr const char* name = "hair_t_trt";
  static constexpr const char* title = "Transmittance of TRT";
  static constexpr const char* source = exact_source;
  static constexpr const char* doc = "C^(cosγ_t/cosθ_t) at the offset h: two traversals.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& color, const T& ior, const T& offset) {
    Inclinations<G> inclinations = make_inclinations(g);
    InnerCosines<T> inner = inner_cosines(ior, offset, inclinations.cos_theta_d);
    return pow(color, inner.gamma / inner.theta);
  }
};

struct TrtTransmittanceFitText : HairTermText {
  static constexpr const char* name = "hair_t_trt_fit";
  static constexpr const char* title = "Unreal's transmittance of TRT";
  static constexpr const char* doc = "C^(t/cosθ_d): θ_d stands where θ_t is meant.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& color, const T& exponent) {
    Inclinations<G> inclinations = make_inclinations(g);
    return pow(color, hair_trt_exponent_fit(exponent, inclinations.cos_theta_d));
  }
};

struct LongitudinalText : HairTermText {
  static constexpr const char* name = "hair_m";
  static constexpr const char* title = "Longitudinal distribution";
  static constexpr const char* source = exact_source;
  static constexpr const char* doc = "exp(-sinθ_l sinθ_v/v) I0(cosθ_l cosθ_v/v)/(2v sinh(1/v)), v = β²; no tilt.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& width) {
    Inclinations<G> i = make_inclinations(g);
    return call<HairBesselM>(width, i.sin_theta_l, i.cos_theta_l, i.sin_theta_v, i.cos_theta_v);
  }
};

struct LongitudinalFitText : HairTermText {
  static constexpr const char* name = "hair_m_fit";
  static constexpr const char* title = "Unreal's longitudinal distribution";
  static constexpr const char* doc = "The normal density of sinθ_l + sinθ_v with deviation β; no tilt.";

  template <class G, class T>
  LOBEFIT_TEXT static auto at(const Geometry<G>& g, const T& width) {
    Inclinations<G> inclinations = make_inclinations(g);
    return call<HairGaussian>(width, inclinations.sin_theta_l + inclinations.sin_theta_v);
  }
};

namespace hair_term {

constexpr ParameterInfo constant(std::string_view name, std::string_view symbol, double lower, double upper,
                                 double initial, std::string_view doc) {
  return {.name = name, .symbol = symbol, .lower = lower, .upper = upper, .initial = initial, .doc = doc};
}

inline constexpr ParameterInfo color =
    constant("base_color", "C", 0.0, 1.0, 0.5, "What a TRT path along the diameter leaves of white.");
inline constexpr ParameterInfo width = constant("width", "β", 1e-3, 4.0, 0.1, "Width of the lobe.");
inline constexpr ParameterInfo eta_prime_inverse =
    constant("eta_prime_inverse", "c_1", 0.1, 3.0, 1.19, "Factor of 1/cosθ_d.");
inline constexpr ParameterInfo eta_prime_cosine =
    constant("eta_prime_cosine", "c_2", 0.0, 3.0, 0.36, "Factor of cosθ_d.");
inline constexpr ParameterInfo tt_offset_constant =
    constant("tt_offset_constant", "h_0", 0.0, 2.0, 0.6, "Constant part.");
inline constexpr ParameterInfo tt_offset_cosine =
    constant("tt_offset_cosine", "h_1", 0.0, 2.0, 0.8, "Factor of -cosφ.");
inline constexpr ParameterInfo tt_scale = constant("scale", "s", 0.05, 2.0, 0.35, "Scale of the logistic density.");
inline constexpr ParameterInfo tt_azimuth_cosine =
    constant("tt_azimuth_cosine", "d_1", 0.0, 10.0, 3.65, "Factor of -cosφ in the exponent.");
inline constexpr ParameterInfo tt_azimuth_constant =
    constant("tt_azimuth_constant", "d_0", 0.0, 10.0, 3.98, "Constant part of the exponent, negated.");
inline constexpr ParameterInfo trt_scale = constant("scale", "s", 0.05, 2.0, 0.15, "Scale of the logistic density.");
inline constexpr ParameterInfo trt_share = constant("share", "w", 0.0, 1.0, 0.75, "Factor of the density.");
inline constexpr ParameterInfo trt_azimuth_cosine =
    constant("trt_azimuth_cosine", "e_1", 0.0, 30.0, 17.0, "Factor of cosφ in the exponent.");
inline constexpr ParameterInfo trt_azimuth_constant =
    constant("trt_azimuth_constant", "e_0", 0.0, 30.0, 16.78, "Constant part of the exponent, negated.");
inline constexpr ParameterInfo tt_absorption = constant("tt_absorption", "t_TT", 0.0, 2.0, 0.5, "Exponent's factor.");
inline constexpr ParameterInfo trt_absorption =
    constant("trt_absorption", "t_TRT", 0.0, 2.0, 0.8, "Exponent's factor.");
inline constexpr ParameterInfo trt_offset =
    constant("trt_offset", "h", 0.0, 1.0, 0.86602540378443865, "Offset of the ray from the axis: √3/2 in S3.");

}  // namespace hair_term

using HairEtaPrime = Term<EtaPrimeText, hair_ior_parameter>;
using HairEtaPrimeFit = Term<EtaPrimeFitText, hair_term::eta_prime_inverse, hair_term::eta_prime_cosine>;
using HairHTt = Term<TtOffsetText, hair_ior_parameter>;
using HairHTtFit =
    Term<TtOffsetFitText, hair_ior_parameter, hair_term::tt_offset_constant, hair_term::tt_offset_cosine>;
using HairDTt = Term<TtAzimuthText, hair_term::tt_scale>;
using HairDTtFit = Term<TtAzimuthFitText, hair_term::tt_azimuth_cosine, hair_term::tt_azimuth_constant>;
using HairDTrt = Term<TrtAzimuthText, hair_term::trt_scale, hair_term::trt_share>;
using HairDTrtFit = Term<TrtAzimuthFitText, hair_term::trt_azimuth_cosine, hair_term::trt_azimuth_constant>;
using HairTTt = Term<TtTransmittanceText, hair_term::color, hair_ior_parameter>;
using HairTTtPrinted = Term<TtTransmittancePrintedText, hair_term::color, hair_ior_parameter>;
using HairTTtFit = Term<TtTransmittanceFitText, hair_term::color, hair_ior_parameter, hair_term::tt_absorption>;
using HairTTrt = Term<TrtTransmittanceText, hair_term::color, hair_ior_parameter, hair_term::trt_offset>;
using HairTTrtFit = Term<TrtTransmittanceFitText, hair_term::color, hair_term::trt_absorption>;
using HairM = Term<LongitudinalText, hair_term::width>;
using HairMFit = Term<LongitudinalFitText, hair_term::width>;

}  // namespace lobefit
