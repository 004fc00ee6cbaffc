// Closed forms of directional albedos: how much of the light one bounce returns.
//
// GGX with height-correlated Smith masking: E(μ, α) for F = 1, and Schlick's split E_F = f0 A + f90 B.
#pragma once

#include <tuple>

#include "models/approximations/form.h"

namespace lobefit {

/// Karis 2014, Physically Based Shading on Mobile: Lazarov's form (2013) refitted to Unreal's GGX. One form for both
/// weights; x: μ, α.
template <class T>
LOBEFIT_TEXT T karis_weight(const std::array<T, 6>& k, const std::array<T, 2>& x) {
  const T roughness = let("roughness", sqrt(x[1]));
  const T smoothness = let("smoothness", 1.0 - roughness);
  const T falloff = min(smoothness * smoothness, exp2(k[0] * x[0])) * smoothness + (k[1] * roughness + k[2]);
  return k[3] * falloff + k[4] * roughness + k[5];
}

struct KarisScale {
  static constexpr std::string_view name = "karis_scale", title = "Karis's weight of f0",
                                    formula = "A = a t + b r + c, t = min((1 - r)², 2^(e μ))(1 - r) + s r + o, r = √α",
                                    source = "Karis 2014, after Lazarov 2013";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr std::array constants{FormConstant{"e", -9.28, -40.0, 0.0}, FormConstant{"s", -0.0275, -2.0, 2.0},
                                        FormConstant{"o", 0.0425, -2.0, 2.0}, FormConstant{"a", -1.04, -4.0, 4.0},
                                        FormConstant{"b", -0.572, -4.0, 4.0}, FormConstant{"c", 1.04, -4.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 6>& k, const std::array<T, 2>& x) {
    return karis_weight(k, x);
  }
};

struct KarisBias {
  static constexpr std::string_view name = "karis_bias", title = "Karis's weight of f90",
                                    formula = "B = a t + b r + c, t as for A",
                                    source = "Karis 2014, after Lazarov 2013";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr std::array constants{FormConstant{"e", -9.28, -40.0, 0.0}, FormConstant{"s", -0.0275, -2.0, 2.0},
                                        FormConstant{"o", 0.0425, -2.0, 2.0}, FormConstant{"a", 1.04, -4.0, 4.0},
                                        FormConstant{"b", 0.022, -4.0, 4.0},  FormConstant{"c", -0.04, -4.0, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 6>& k, const std::array<T, 2>& x) {
    return karis_weight(k, x);
  }
};

/// Of 1, x, y, xy, x², y², x²y, xy², x²y².
template <class T>
LOBEFIT_TEXT T biquadratic(const std::array<T, 9>& k, const T& x, const T& y) {
  return k[0] + k[1] * x + k[4] * x * x + y * (k[2] + k[3] * x + k[6] * x * x) +
         y * y * (k[5] + k[7] * x + k[8] * x * x);
}
template <class T>
LOBEFIT_TEXT T biquadratic_ratio(const std::array<T, 17>& k, const std::array<T, 2>& x) {
  const T above = let("above", biquadratic<T>({k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], k[8]}, x[0], x[1]));
  const T below =
      let("below", biquadratic<T>({T(1.0), k[9], k[10], k[11], k[12], k[13], k[14], k[15], k[16]}, x[0], x[1]));
  return saturate(above / below);
}

#define LOBEFIT_RATIO_CONSTANT(name, value) \
  FormConstant { name, value, -2000.0, 2000.0 }

/// MaterialX, mx_ggx_dir_albedo_analytic: rational quadratics in μ and α.
struct MaterialXScale {
  static constexpr std::string_view name = "materialx_scale", title = "MaterialX's weight of f0",
                                    formula = "A = Σ p_ij μ^i α^j / Σ q_ij μ^i α^j, i, j ≤ 2",
                                    source = "MaterialX, mx_ggx_dir_albedo_analytic";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr std::array constants{LOBEFIT_RATIO_CONSTANT("p00", 0.1003), LOBEFIT_RATIO_CONSTANT("p10", -0.6303),
                                        LOBEFIT_RATIO_CONSTANT("p01", 9.748),  LOBEFIT_RATIO_CONSTANT("p11", -2.038),
                                        LOBEFIT_RATIO_CONSTANT("p20", 29.34),  LOBEFIT_RATIO_CONSTANT("p02", -8.245),
                                        LOBEFIT_RATIO_CONSTANT("p21", -26.44), LOBEFIT_RATIO_CONSTANT("p12", 19.99),
                                        LOBEFIT_RATIO_CONSTANT("p22", -5.448), LOBEFIT_RATIO_CONSTANT("q10", -1.765),
                                        LOBEFIT_RATIO_CONSTANT("q01", 8.263),  LOBEFIT_RATIO_CONSTANT("q11", 11.53),
                                        LOBEFIT_RATIO_CONSTANT("q20", 28.96),  LOBEFIT_RATIO_CONSTANT("q02", -7.507),
                                        LOBEFIT_RATIO_CONSTANT("q21", -36.11), LOBEFIT_RATIO_CONSTANT("q12", 15.86),
                                        LOBEFIT_RATIO_CONSTANT("q22", 33.37)};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 17>& k, const std::array<T, 2>& x) {
    return biquadratic_ratio(k, x);
  }
};

struct MaterialXBias {
  static constexpr std::string_view name = "materialx_bias", title = "MaterialX's weight of f90",
                                    formula = "B = Σ p_ij μ^i α^j / Σ q_ij μ^i α^j, i, j ≤ 2",
                                    source = "MaterialX, mx_ggx_dir_albedo_analytic";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr std::array constants{LOBEFIT_RATIO_CONSTANT("p00", 0.9345), LOBEFIT_RATIO_CONSTANT("p10", -2.323),
                                        LOBEFIT_RATIO_CONSTANT("p01", 2.229),  LOBEFIT_RATIO_CONSTANT("p11", -3.748),
                                        LOBEFIT_RATIO_CONSTANT("p20", 1.424),  LOBEFIT_RATIO_CONSTANT("p02", -0.7684),
                                        LOBEFIT_RATIO_CONSTANT("p21", 1.436),  LOBEFIT_RATIO_CONSTANT("p12", 0.2913),
                                        LOBEFIT_RATIO_CONSTANT("p22", 0.6286), LOBEFIT_RATIO_CONSTANT("q10", 0.2281),
                                        LOBEFIT_RATIO_CONSTANT("q01", 15.94),  LOBEFIT_RATIO_CONSTANT("q11", -55.83),
                                        LOBEFIT_RATIO_CONSTANT("q20", 13.08),  LOBEFIT_RATIO_CONSTANT("q02", 41.26),
                                        LOBEFIT_RATIO_CONSTANT("q21", 54.9),   LOBEFIT_RATIO_CONSTANT("q12", 300.2),
                                        LOBEFIT_RATIO_CONSTANT("q22", -285.1)};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 17>& k, const std::array<T, 2>& x) {
    return biquadratic_ratio(k, x);
  }
};

#undef LOBEFIT_RATIO_CONSTANT

/// What is lost, in the coordinate in which it is smooth: grazing angles μ ~ α lose most, and like (α/μ)² beyond.
struct GgxLossForm {
  static constexpr std::string_view name = "ggx_loss", title = "Directional albedo of GGX",
                                    formula = "E = 1 - s² (p0 + p1 α + μ (q0 + q1 α) + s (r0 + r1 α)), s = kα/(μ + kα)",
                                    source = "lobefit";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr std::array constants{FormConstant{"k", 3.0, 0.05, 40.0},   FormConstant{"p0", 0.3, -20.0, 20.0},
                                        FormConstant{"p1", 0.1, -20.0, 20.0}, FormConstant{"q0", 0.0, -20.0, 20.0},
                                        FormConstant{"q1", 0.0, -20.0, 20.0}, FormConstant{"r0", 0.0, -20.0, 20.0},
                                        FormConstant{"r1", 0.0, -20.0, 20.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 7>& k, const std::array<T, 2>& x) {
    const T c = let("c", k[0] * x[1]);
    const T s = let("s", c / (x[0] + c));
    const T u = let("u", k[1] + k[3] * x[0] + k[5] * s + x[1] * (k[2] + k[4] * x[0] + k[6] * s));
    return 1.0 - s * s * u;
  }
};

/// The mean of Schlick's weight over a lobe's light: Schlick's own at α = 0.
struct SchlickWeightForm {
  static constexpr std::string_view name = "schlick_weight", title = "Mean Schlick weight of a GGX lobe",
                                    formula = "(1 - μ)^(5 e^(-a r))/(1 + b r^p), r = √α",
                                    source =
                                        "Form of Belyaev's water, after Bruneton et al. 2010: a = 2.69, b = 22.7, "
                                        "p = 1.5 over the deviation of slopes";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr std::array constants{FormConstant{"a", 2.69, -5.0, 20.0}, FormConstant{"b", 22.7, 0.0, 200.0},
                                        FormConstant{"p", 1.5, 0.1, 10.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 3>& k, const std::array<T, 2>& x) {
    const T r = let("r", sqrt(x[1]));
    return pow(T(1.0 - x[0]), T(5.0 * exp(-k[0] * r))) / (1.0 + k[1] * pow(r, k[2]));
  }
};

/// 1 - E_avg.
struct GgxAverageLossForm {
  static constexpr std::string_view name = "ggx_average_loss_form", title = "Mean loss of a GGX lobe",
                                    formula = "1 - E_avg = α² (p0 + p1 α)/(1 + q1 α + q2 α²)", source = "lobefit";
  static constexpr std::array<std::string_view, 1> arguments{"alpha"};
  static constexpr std::array constants{FormConstant{"p0", 2.0, 0.0, 50.0}, FormConstant{"p1", 1.0, -50.0, 50.0},
                                        FormConstant{"q1", 3.0, -5.0, 100.0}, FormConstant{"q2", 1.0, -50.0, 100.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 4>& k, const std::array<T, 1>& x) {
    const T a = x[0];
    return a * a * (k[0] + k[1] * a) / (1.0 + a * (k[2] + k[3] * a));
  }
};

/// MaterialX, mx_imageworks_sheen_dir_albedo_analytic.
struct MaterialXSheenAlbedo {
  static constexpr std::string_view name = "materialx_sheen", title = "Directional albedo of Charlie sheen",
                                    formula = "E = (p0 + p1 μ + p2 r + p3 μ r + p4 μ² + p5 r²)/(1 + q1 μ + …)",
                                    source = "MaterialX, mx_imageworks_sheen_dir_albedo_analytic";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "roughness"};
  static constexpr std::array constants{
      FormConstant{"p0", 13.673, -1e4, 1e4},     FormConstant{"p1", -68.78018, -1e4, 1e4},
      FormConstant{"p2", 799.08825, -1e4, 1e4},  FormConstant{"p3", -905.00061, -1e4, 1e4},
      FormConstant{"p4", 60.28956, -1e4, 1e4},   FormConstant{"p5", 1086.96473, -1e4, 1e4},
      FormConstant{"q1", 61.57746, -1e4, 1e4},   FormConstant{"q2", 442.78211, -1e4, 1e4},
      FormConstant{"q3", 2597.49308, -1e5, 1e5}, FormConstant{"q4", 121.81241, -1e4, 1e4},
      FormConstant{"q5", 3045.55075, -1e5, 1e5}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 11>& k, const std::array<T, 2>& x) {
    const T above = let("above", k[0] + x[0] * (k[1] + k[4] * x[0]) + x[1] * (k[2] + k[3] * x[0] + k[5] * x[1]));
    const T below = let("below", 1.0 + x[0] * (k[6] + k[9] * x[0]) + x[1] * (k[7] + k[8] * x[0] + k[10] * x[1]));
    return above / below;
  }
};

using AlbedoForms = std::tuple<KarisScale, KarisBias, MaterialXScale, MaterialXBias, GgxLossForm, SchlickWeightForm,
                               GgxAverageLossForm, MaterialXSheenAlbedo>;

}  // namespace lobefit
