// From a factor's text to a registered term.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "models/model.h"

namespace lobefit {

/// Of the half vector, unless the text says otherwise.
template <class Text>
constexpr ModelKind term_kind() {
  if constexpr (requires { Text::kind; }) {
    return Text::kind;
  } else {
    return ModelKind::term;
  }
}

/// `Text` at the half vector of wi and wo, its parameters declared one by one:
///
///   using DGgx = Term<GgxDistribution, term_alpha>;    // Text::at(geometry, alpha)
template <class Text, const ParameterInfo&... declared>
struct Term {
  static constexpr ModelInfo info{.name = Text::name,
                                  .title = Text::title,
                                  .source = Text::source,
                                  .kind = term_kind<Text>(),
                                  // In that it doesn't care which direction is the light's.
                                  .reciprocal = true,
                                  .isotropic = ((declared.name != "alpha_x") && ...),
                                  .doc = Text::doc};

  template <class T>
  struct Parameters {
    std::array<T, sizeof...(declared)> values;
  };

  template <class P, class Visit>
  static constexpr void describe([[maybe_unused]] P& p, [[maybe_unused]] Visit&& visit) {
    [[maybe_unused]] std::size_t i = 0;
    (visit(p.values[i++], declared), ...);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    return at(p, g, std::make_index_sequence<sizeof...(declared)>{});
  }

 private:
  template <class T, class G, std::size_t... i>
  LOBEFIT_TEXT static Vec3<T> at([[maybe_unused]] const Parameters<T>& p, const Geometry<G>& g,
                                 std::index_sequence<i...>) {
    return grey(T(Text::at(g, p.values[i]...)));
  }
};

/// Alphas end at .001 (Disney's own limit), where a lobe is 0.1° wide.
inline constexpr ParameterInfo specular_alpha_parameter{
    .name = "alpha", .symbol = "α", .lower = 1e-3, .initial = 0.5, .doc = "The square of perceptual roughness."};
inline constexpr ParameterInfo specular_alpha_x_parameter{
    .name = "alpha_x", .symbol = "α_x", .lower = 1e-3, .initial = 0.5, .doc = "Alpha along x, the tangent."};
inline constexpr ParameterInfo specular_alpha_y_parameter{
    .name = "alpha_y", .symbol = "α_y", .lower = 1e-3, .initial = 0.25, .doc = "Alpha along y, the bitangent."};
inline constexpr ParameterInfo term_f0_parameter{
    .name = "f0", .symbol = "F_0", .initial = 0.04, .doc = "Reflectance at normal incidence."};
inline constexpr ParameterInfo term_f90_parameter{
    .name = "f90", .symbol = "F_90", .initial = 1.0, .doc = "Reflectance at grazing angles."};

}  // namespace lobefit
