// What Unreal's hair (S3) puts in place of d'Eon's integrals.
#pragma once

#include <tuple>

#include "models/approximations/form.h"
#include "models/hair/longitudinal.h"
#include "models/hair/unreal_fits.h"

namespace lobefit {

/// Bravais's index of a skew ray.
struct HairModifiedIndex {
  static constexpr std::string_view name = "hair_modified_index", title = "Bravais index of hair",
                                    formula = "η' = c1/cosθ_d + c2 cosθ_d", source = "S3; Karis 2016";
  static constexpr std::array<std::string_view, 1> arguments{"cos_theta_d"};
  static constexpr std::array constants{FormConstant{"c1", 1.19, 0.1, 4.0}, FormConstant{"c2", 0.36, -2.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 1>& x) {
    return hair_index_fit(c[0], c[1], x[0]);
  }
};

/// The same for every index of the fibre.
struct HairModifiedIndexOfIor {
  static constexpr std::string_view name = "hair_modified_index_of_ior", title = "Bravais index of hair, any index",
                                    formula = "η' = (p0 + p1 η)/cosθ_d + (q0 + q1 η) cosθ_d", source = "lobefit";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta_d", "ior"};
  static constexpr std::array constants{FormConstant{"p0", -0.7, -4.0, 4.0}, FormConstant{"p1", 1.2, -4.0, 4.0},
                                        FormConstant{"q0", 0.7, -4.0, 4.0}, FormConstant{"q1", -0.2, -4.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 4>& c, const std::array<T, 2>& x) {
    return hair_index_fit(T(c[0] + c[1] * x[1]), T(c[2] + c[3] * x[1]), x[0]);
  }
};

/// Where on the fibre's width light enters that leaves by TT at an azimuth.
struct HairTtOffset {
  static constexpr std::string_view name = "hair_tt_offset", title = "Offset of the TT ray",
                                    formula = "h_TT = cos(φ/2) (1 + (c0 - c1 cosφ)/η')", source = "S3, code";
  static constexpr std::array<std::string_view, 2> arguments{"cos_phi", "inverse_index"};
  static constexpr std::array constants{FormConstant{"c0", 0.6, -2.0, 3.0}, FormConstant{"c1", 0.8, -2.0, 3.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 2>& x) {
    return hair_tt_offset_fit(c[0], c[1], x[1], x[0], T(sqrt(0.5 + 0.5 * x[0])));
  }
};

/// An azimuthal lobe.
struct ExponentialCosine {
  static constexpr std::string_view name = "exponential_cosine", title = "Azimuthal lobe",
                                    formula = "D = exp(d1 cosφ - d0)", source = "S3";
  static constexpr std::array<std::string_view, 1> arguments{"cos_phi"};
  static constexpr std::array constants{FormConstant{"d1", 17.0, -60.0, 60.0}, FormConstant{"d0", 16.78, -10.0, 70.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 1>& x) {
    return hair_azimuth_fit(c[0], c[1], x[0]);
  }
};

/// The same lobe made to integrate to its weight over the circle: one constant does the work of two.
struct VonMises {
  static constexpr std::string_view name = "von_mises", title = "Azimuthal lobe of given weight",
                                    formula = "D = w exp(κ cosφ)/(2π I0(κ)), κ of either sign",
                                    source = "von Mises 1918";
  static constexpr std::array<std::string_view, 1> arguments{"cos_phi"};
  static constexpr std::array constants{FormConstant{"kappa", 10.0, -60.0, 60.0},
                                        FormConstant{"weight", 1.0, 0.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 1>& x) {
    const T size = let("size", abs(c[0]));
    return c[1] * exp(c[0] * x[0] - size) / (2.0 * pi * call<ScaledBesselI0>(size));
  }
};

/// sin²γ_t of the TT ray in the code's own index.
template <class T>
LOBEFIT_TEXT T hair_inner_sine2(const T& c1, const T& c2, const T& cos_theta_d, const T& h) {
  const T a = let("a", hair_inverse_index_fit(c1, c2, cos_theta_d));
  return let("inner", h * h * (a * a));
}

/// Exponent of the colour on the way of TT.
struct HairTtExponent {
  static constexpr std::string_view name = "hair_tt_exponent", title = "Absorption of TT",
                                    formula = "T = C^(t √(1 - h²/η'²)/cosθ_d)", source = "S3";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta_d", "h"};
  static constexpr std::array constants{FormConstant{"t", 0.5, 0.0, 2.0}, FormConstant{"c1", 1.19, 0.1, 4.0},
                                        FormConstant{"c2", 0.36, -2.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 3>& c, const std::array<T, 2>& x) {
    return hair_tt_exponent_fit(c[0], T(sqrt(1.0 - hair_inner_sine2(c[1], c[2], x[0], x[1]))), x[0]);
  }
};

/// The same length where absorption comes by Chiang's map, as the code has it: a bracket closes too late.
struct HairTtChordAsCoded {
  static constexpr std::string_view name = "hair_tt_chord_as_coded", title = "Chord of TT, as coded",
                                    formula = "t |1 - (h/η')²/cosθ_d|", source = "S3, code";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta_d", "h"};
  static constexpr std::array constants{FormConstant{"t", 1.0, 0.0, 4.0}, FormConstant{"c1", 1.19, 0.1, 4.0},
                                        FormConstant{"c2", 0.36, -2.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 3>& c, const std::array<T, 2>& x) {
    return c[0] * hair_tt_chord_as_coded(hair_inner_sine2(c[1], c[2], x[0], x[1]), x[0]);
  }
};

/// With the bracket closed.
struct HairTtChord {
  static constexpr std::string_view name = "hair_tt_chord", title = "Chord of TT, bracket closed",
                                    formula = "t (1 - (h/η')²)/cosθ_d", source = "S3, code, mended";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta_d", "h"};
  static constexpr std::array constants{FormConstant{"t", 1.0, 0.0, 4.0}, FormConstant{"c1", 1.19, 0.1, 4.0},
                                        FormConstant{"c2", 0.36, -2.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 3>& c, const std::array<T, 2>& x) {
    return c[0] * hair_tt_chord(hair_inner_sine2(c[1], c[2], x[0], x[1]), x[0]);
  }
};

/// Exponent of the colour on the way of TRT.
struct HairTrtExponent {
  static constexpr std::string_view name = "hair_trt_exponent", title = "Absorption of TRT",
                                    formula = "T = C^(t/cosθ_d)", source = "S3";
  static constexpr std::array<std::string_view, 1> arguments{"cos_theta_d"};
  static constexpr std::array constants{FormConstant{"t", 0.8, 0.0, 2.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 1>& c, const std::array<T, 1>& x) {
    return hair_trt_exponent_fit(c[0], x[0]);
  }
};

/// Fresnel's factors of TRT at one offset h = √(1 - g²).
struct HairTrtFresnel {
  static constexpr std::string_view name = "hair_trt_fresnel", title = "Fresnel factors of TRT at one offset",
                                    formula = "(1 - F)² F, F = f0 + (1 - f0)(1 - g cosθ_d)⁵",
                                    source = "S3, code: g = 1/2, h = sqrt(3)/2";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta_d", "f0"};
  static constexpr std::array constants{FormConstant{"g", 0.5, 0.0, 1.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 1>& c, const std::array<T, 2>& x) {
    return hair_trt_fresnel_fit(c[0], x[0], x[1]);
  }
};

/// The Gaussian in sines in place of d'Eon's M.
struct HairGaussianLobe {
  static constexpr std::string_view name = "hair_gaussian", title = "Longitudinal lobe of hair",
                                    formula = "M = g exp(-(sinθ_l + sinθ_v)²/(2 s²β²))/(s β √(2π))", source = "S3";
  static constexpr std::array<std::string_view, 3> arguments{"sin_theta_l", "sin_theta_v", "width"};
  static constexpr std::array constants{FormConstant{"s", 1.0, 0.1, 4.0}, FormConstant{"g", 1.0, 0.1, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 3>& x) {
    return c[1] * call<HairGaussian>(T(c[0] * x[2]), T(x[0] + x[1]));
  }
};

/// The same with the width of a cone's projection: a lobe of β in θ is β cosθ in sinθ.
struct HairProjectedGaussianLobe {
  static constexpr std::string_view name = "hair_projected_gaussian", title = "Longitudinal lobe of hair, projected",
                                    formula =
                                        "M = g exp(-x²/(2 s²β²))/(s β √(2π) cosθ_d), x = (sinθ_l + sinθ_v)/cosθ_d, "
                                        "cosθ_d as the mean of both cosines",
                                    source = "lobefit";
  static constexpr std::array<std::string_view, 3> arguments{"sin_theta_l", "sin_theta_v", "width"};
  static constexpr std::array constants{FormConstant{"s", 1.0, 0.1, 4.0}, FormConstant{"g", 1.0, 0.1, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 3>& x) {
    const T cosine = let("cosine", max(0.5 * (sqrt(1.0 - x[0] * x[0]) + sqrt(1.0 - x[1] * x[1])), 1e-3));
    return c[1] * call<HairGaussian>(T(c[0] * x[2]), T((x[0] + x[1]) / cosine)) / cosine;
  }
};

using HairForms = std::tuple<HairModifiedIndex, HairModifiedIndexOfIor, HairTtOffset, ExponentialCosine, VonMises,
                             HairTtExponent, HairTtChordAsCoded, HairTtChord, HairTrtExponent, HairTrtFresnel,
                             HairGaussianLobe, HairProjectedGaussianLobe>;

}  // namespace lobefit
