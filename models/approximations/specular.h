// What engines put in place of Smith's masking and Fresnel's equations.
#pragma once

#include <tuple>

#include "models/approximations/form.h"
#include "models/microfacet/masking.h"
#include "models/microfacet/sampling.h"

namespace lobefit {

/// Schlick's G1 with k as a power of alpha.
struct SchlickMaskingForm {
  static constexpr std::string_view name = "schlick_masking", title = "Schlick's masking",
                                    formula = "G1 = μ/(μ (1 - k) + k), k = c α^p",
                                    source = "Schlick 1994; Karis 2013 (c = 1/2 for GGX, sqrt(2/pi) for Beckmann)";
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr std::array constants{FormConstant{"c", 0.5, 0.0, 2.0}, FormConstant{"p", 1.0, 0.1, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 2>& x) {
    return call<SchlickG1>(x[0], T(c[0] * pow(x[1], c[1])));
  }
};

/// Unreal's joint visibility, whose square roots are lerps.
struct JointVisibilityForm {
  static constexpr std::string_view name = "joint_visibility", title = "Approximate joint Smith visibility",
                                    formula = "V = ½/(μ_i (μ_o (1 - a) + a) + μ_o (μ_i (1 - a) + a)), a = c α^p",
                                    source = "S4, Vis_SmithJointApprox (c = p = 1)";
  static constexpr std::array<std::string_view, 3> arguments{"cos_theta_i", "cos_theta_o", "alpha"};
  static constexpr std::array constants{FormConstant{"c", 1.0, 0.1, 2.0}, FormConstant{"p", 1.0, 0.1, 4.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 3>& x) {
    return call<SmithJointApproximation>(x[0], x[1], T(c[0] * pow(x[2], c[1])));
  }
};

/// Walter's rational G1 of Beckmann facets over c = cot θ/α; 1 from 1.6 on.
struct BeckmannRationalForm {
  static constexpr std::string_view name = "beckmann_rational", title = "Rational Smith masking of Beckmann facets",
                                    formula = "G1 = min((p1 c + p2 c²)/(1 + q1 c + q2 c²), 1), c = min(cotθ/α, 1.6)",
                                    source = "Walter et al. 2007, section 5.1";
  static constexpr std::array<std::string_view, 1> arguments{"cotangent"};
  static constexpr std::array constants{FormConstant{"p1", walter_beckmann_constants[0], 0.0, 10.0},
                                        FormConstant{"p2", walter_beckmann_constants[1], 0.0, 20.0},
                                        FormConstant{"q1", walter_beckmann_constants[2], 0.0, 10.0},
                                        FormConstant{"q2", walter_beckmann_constants[3], 0.0, 20.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 4>& k, const std::array<T, 1>& x) {
    return walter_beckmann_g1(k, x[0]);
  }
};

/// The same without the step: the slope at 0 is Smith's own, 2 √π/2 … and the limit 1 is the form's.
struct BeckmannLimitForm {
  static constexpr std::string_view name = "beckmann_limit",
                                    title = "Rational Smith masking of Beckmann facets, limits kept",
                                    formula = "G1 = (2√π c + p2 c² + p3 c³)/(1 + q1 c + p2 c² + p3 c³)",
                                    source = "lobefit";
  static constexpr std::array<std::string_view, 1> arguments{"cotangent"};
  static constexpr std::array constants{FormConstant{"p2", 2.0, -20.0, 40.0}, FormConstant{"p3", 5.0, 0.0, 80.0},
                                        FormConstant{"q1", 3.5, 0.0, 10.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 3>& k, const std::array<T, 1>& x) {
    const T tail = let("tail", x[0] * x[0] * (k[0] + k[1] * x[0]));
    return (3.544907701811032 * x[0] + tail) / (1.0 + k[2] * x[0] + tail);
  }
};

/// ∫ D V μ_i dω_i of GGX facets over a grid of visible normals: what a visibility makes of the directional albedo. A
/// form by quadrature has no shader; its arguments are plain numbers.
template <class Form>
struct GgxAlbedoWith {
  static constexpr bool quadrature = true;
  static constexpr std::array<std::string_view, 2> arguments{"cos_theta", "alpha"};
  static constexpr auto constants = Form::constants;
  static constexpr int steps = 32;

  template <class T>
  static T evaluate(const std::array<T, constants.size()>& c, const std::array<double, 2>& x) {
    const double mu = x[0], alpha = x[1];
    const Direction wo{sqrt(1.0 - mu * mu), 0.0, mu};
    // A visible normal has the density D G1(μ)/(4 μ) as a light.
    const double masking = 2.0 * mu / (mu + sqrt(mu * mu * (1.0 - alpha * alpha) + alpha * alpha));
    T sum(0.0);
    for (int i = 0; i < steps * steps; ++i) {
      const double mu_i = sample_visible_reflection(Distribution::ggx, alpha, wo,
                                                    {(i % steps + 0.5) / steps, (i / steps + 0.5) / steps})
                              .z;
      if (mu_i > 0.0) sum = sum + visibility<T>(c, mu_i, mu, alpha) * (4.0 * mu_i * mu / masking);
    }
    return sum / static_cast<double>(steps * steps);
  }

 private:
  template <class T>
  static T visibility(const std::array<T, constants.size()>& c, double mu_i, double mu_o, double alpha) {
    if constexpr (Form::arguments.size() == 3) {
      return Form::template evaluate<T>(c, {T(mu_i), T(mu_o), T(alpha)});
    } else {
      return Form::template evaluate<T>(c, {T(mu_i), T(alpha)}) * Form::template evaluate<T>(c, {T(mu_o), T(alpha)}) /
             (4.0 * mu_i * mu_o);
    }
  }
};

struct GgxAlbedoWithSchlickK : GgxAlbedoWith<SchlickMaskingForm> {
  static constexpr std::string_view name = "ggx_albedo_with_schlick_k", title = "Albedo of GGX under Schlick's masking",
                                    formula = "∫ D G1(μ_i) G1(μ_o)/(4 μ_o) dω_i, k = c α^p",
                                    source = "Karis 2013 (c = 1/2)";
};
struct GgxAlbedoWithJointVisibility : GgxAlbedoWith<JointVisibilityForm> {
  static constexpr std::string_view name = "ggx_albedo_with_joint_visibility",
                                    title = "Albedo of GGX under the approximate joint visibility",
                                    formula = "∫ D V μ_i dω_i, a = c α^p", source = "S4, Vis_SmithJointApprox";
};

struct SchlickFresnelForm {
  static constexpr std::string_view name = "schlick_fresnel", title = "Schlick's Fresnel term",
                                    formula = "F = f0 + (1 - f0)(1 - c)^n", source = "Schlick 1994 (n = 5)";
  static constexpr std::array<std::string_view, 2> arguments{"cosine", "f0"};
  static constexpr std::array constants{FormConstant{"n", 5.0, 1.0, 12.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 1>& c, const std::array<T, 2>& x) {
    return x[1] + (1.0 - x[1]) * pow(T(1.0 - x[0]), c[0]);
  }
};

struct SphericalGaussianFresnelForm {
  static constexpr std::string_view name = "spherical_gaussian_fresnel", title = "Spherical-Gaussian Fresnel term",
                                    formula = "F = f0 + (1 - f0) 2^((a c + b) c)", source = "Lagarde 2012; Karis 2013";
  static constexpr std::array<std::string_view, 2> arguments{"cosine", "f0"};
  static constexpr std::array constants{FormConstant{"a", -5.55473, -30.0, 10.0},
                                        FormConstant{"b", -6.98316, -20.0, 5.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 2>& x) {
    return x[1] + (1.0 - x[1]) * exp2((c[0] * x[0] + c[1]) * x[0]);
  }
};

/// Schlick's term with what metals lack before they graze.
struct LazanyiFresnelForm {
  static constexpr std::string_view name = "lazanyi_fresnel", title = "Schlick's term for metals",
                                    formula = "F = f0 + (1 - f0)(1 - c)⁵ - a c (1 - c)^n",
                                    source = "Lazanyi, Szirmay-Kalos 2005; Hoffman 2019 (n = 6)";
  static constexpr std::array<std::string_view, 2> arguments{"cosine", "f0"};
  static constexpr std::array constants{FormConstant{"a", 0.0, -5.0, 10.0}, FormConstant{"n", 6.0, 1.0, 12.0}};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const std::array<T, 2>& c, const std::array<T, 2>& x) {
    const T away = let("away", 1.0 - x[0]);
    return x[1] + (1.0 - x[1]) * call<Pow5>(away) - c[0] * x[0] * pow(away, c[1]);
  }
};

using SpecularForms =
    std::tuple<SchlickMaskingForm, JointVisibilityForm, BeckmannRationalForm, BeckmannLimitForm, GgxAlbedoWithSchlickK,
               GgxAlbedoWithJointVisibility, SchlickFresnelForm, SphericalGaussianFresnelForm, LazanyiFresnelForm>;

}  // namespace lobefit
