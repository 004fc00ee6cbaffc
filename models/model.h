// What every BRDF model offers, and how a room evaluates one.
//
//   struct MyModel {
//     static constexpr ModelInfo info{.name = "my_model", …};
//     template <class T> struct Parameters { Vec3<T> albedo; T alpha; };
//     template <class P, class Visit> static constexpr void describe(P& p, Visit&& visit);
//     template <class T, class G>
//     static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g);   // 1/sr, without cosine
//   };
//
// A line in list.def registers it; every room then gets its own translation unit for it.
#pragma once

#include <string_view>

#include "models/geometry.h"
#include "models/parameter.h"
#include "models/scalar.h"

namespace lobefit {

struct ModelInfo {
  std::string_view name;
  std::string_view title;
  std::string_view source;
  /// f(wi, wo) = f(wo, wi) by construction; tested where claimed, measured where not.
  bool reciprocal = false;
  /// Directional albedo ≤ 1 over the whole parameter range, view fixed; tested where claimed, measured where not.
  bool energy_conserving = false;
  bool isotropic = true;
  bool non_negative = true;
  std::string_view doc = "";
};

/// The BRDF of a model in 1/sr, without cosine: 0 unless both directions are above the surface.
template <class M, class T, class G>
LOBEFIT_TEXT Vec3<T> evaluate_brdf(const typename M::template Parameters<T>& p, const Vec3<G>& wi, const Vec3<G>& wo) {
  const Geometry<G> g = make_geometry(wi, wo);
  const Vec3<T> brdf = M::evaluate(p, g);
  return select(min(g.cos_theta_i, g.cos_theta_o) > 0.0, brdf, Vec3<T>{T(0.0), T(0.0), T(0.0)});
}

// Parameters that many models share, declared once.

inline constexpr ParameterInfo albedo_parameter{
    .name = "albedo", .symbol = "ρ", .initial = 1.0, .doc = "Diffuse reflectance, linear Rec.709 RGB."};
inline constexpr ParameterInfo alpha_parameter{
    .name = "alpha", .symbol = "α", .initial = 0.5, .doc = "GGX alpha: the square of perceptual roughness."};
inline constexpr ParameterInfo roughness_parameter{.name = "roughness",
                                                   .symbol = "r",
                                                   .initial = 0.5,
                                                   .doc = "Perceptual roughness; alpha is its square.",
                                                   .perceptual_roughness = true};
inline constexpr ParameterInfo multiple_scattering_parameter{
    .name = "multiple_scattering",
    .symbol = "w",
    .initial = 1.0,
    .tier = Tier::full,
    .doc = "Weight of the model's own term for light that bounces more than once between facets; 0 leaves one bounce."};

}  // namespace lobefit
