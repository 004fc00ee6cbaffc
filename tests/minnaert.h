// A model that the repository does not have: what docs/adding_a_model.md asks for, and notebooks/adding_a_model.ipynb
// compiles.
#pragma once

#include "models/model.h"

namespace lobefit {

/// Minnaert 1941, The Reciprocity Principle in Lunar Photometry: f = ρ (k + 1)/(2π) (μi μo)^(k - 1).
struct Minnaert {
  static constexpr ModelInfo info{.name = "minnaert",
                                  .title = "Minnaert's lunar reflectance",
                                  .source = "Minnaert 1941, The Reciprocity Principle in Lunar Photometry",
                                  .reciprocal = true,
                                  .energy_conserving = true,
                                  .doc = "Lambert at k = 1; larger exponents darken the limb."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T k;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.k, ParameterInfo{.name = "k", .lower = 1.0, .upper = 4.0, .initial = 1.0, .doc = "Limb exponent."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T limb = let("limb", pow(g.cos_theta_i * g.cos_theta_o, p.k - 1.0));
    return p.albedo * ((p.k + 1.0) / (2.0 * pi) * limb);
  }
};

}  // namespace lobefit
