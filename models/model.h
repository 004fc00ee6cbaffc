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
//
// Two things that a model may have beside these:
//   - sample(const Parameters<double>&, wo, u) and pdf(const Parameters<double>&, wi, wo): importance sampling;
//   - named choices of a formula: see choose().
#pragma once

#include <array>
#include <string_view>

#include "models/geometry.h"
#include "models/parameter.h"
#include "models/scalar.h"

namespace lobefit {

enum class ModelKind {
  brdf,       // 1/sr, without cosine; 0 below the horizon
  term,       // a factor of a BRDF, evaluated at the half vector, the same in all channels; 0 below the horizon too
  hair,       // z is the fibre's axis; any direction
  hair_term,  // a factor of a hair model, the same in all channels
};

/// Around a fibre, not on a surface.
constexpr bool is_hair(ModelKind kind) { return kind == ModelKind::hair || kind == ModelKind::hair_term; }
constexpr bool is_term(ModelKind kind) { return kind == ModelKind::term || kind == ModelKind::hair_term; }

inline std::string_view kind_name(ModelKind kind) {
  constexpr std::array<std::string_view, 4> names{"brdf", "term", "hair", "term"};
  return names[static_cast<std::size_t>(kind)];
}

struct ModelInfo {
  std::string_view name;
  std::string_view title;
  std::string_view source;
  ModelKind kind = ModelKind::brdf;
  /// f(wi, wo) = f(wo, wi) by construction; tested where claimed, measured where not.
  bool reciprocal = false;
  /// Directional albedo ≤ 1 over the whole parameter range, view fixed; tested where claimed, measured where not.
  /// Means nothing for a term.
  bool energy_conserving = false;
  bool isotropic = true;
  bool non_negative = true;
  /// f is defined for light from behind too, N·L < 0; the text sees to it. Albedos then count both hemispheres.
  bool transmits = false;
  std::string_view doc = "";
};

/// The BRDF of a model in 1/sr, without cosine: 0 unless both directions are above the surface (the viewer, if the
/// model transmits). A hair model decides that itself.
template <class M, class T, class G>
LOBEFIT_TEXT Vec3<T> evaluate_brdf(const typename M::template Parameters<T>& p, const Vec3<G>& wi, const Vec3<G>& wo) {
  // Not const: see make_geometry().
  Geometry<G> g = make_geometry(wi, wo);
  Vec3<T> brdf = M::evaluate(p, g);
  if constexpr (is_hair(M::info.kind)) {
    return brdf;
  } else if constexpr (M::info.transmits) {
    return select(g.cos_theta_o > 0.0, brdf, Vec3<T>{T(0.0), T(0.0), T(0.0)});
  } else {
    return select(min(g.cos_theta_i, g.cos_theta_o) > 0.0, brdf, Vec3<T>{T(0.0), T(0.0), T(0.0)});
  }
}

/// The same number in all channels.
template <class T>
LOBEFIT_TEXT Vec3<T> grey(const T& value) {
  return {value, value, value};
}

/// One of several formulas by the number of a named choice (ParameterInfo::choices): `choose(p.fresnel, [&] { return
/// …; }, [&] { return …; })`. A branch in double and Dual; nested selects in a shader, whose compiler removes those
/// that Fitted() doesn't need. A vectorised loop can't branch: for the float batches such a model offers, beside
/// evaluate(),
///
///   static constexpr int variant_count = …;                                // one loop each
///   template <int variant> struct Variant { …as a model, with the formula fixed… };
///   static int variant(std::span<const float> flat);                       // which of them these parameters choose
template <int first_choice = 0, class C, class First, class... Rest>
LOBEFIT_TEXT auto choose(const C& choice, const First& first, const Rest&... rest) {
  if constexpr (sizeof...(Rest) == 0) {
    return first();
  } else if constexpr (is_traced<C>) {
    return select(choice < first_choice + 0.5, first(), choose<first_choice + 1>(choice, rest...));
  } else {
    return choice < first_choice + 0.5 ? first() : choose<first_choice + 1>(choice, rest...);
  }
}

/// The number that choose() makes of a choice's value, of `count` choices.
template <class Slot>
constexpr int choice_number(Slot value, int count) {
  int number = 0;
  while (number + 1 < count && value >= static_cast<Slot>(number + 0.5)) ++number;
  return number;
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
