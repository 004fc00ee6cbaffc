// Ashikhmin's velvet as engines evaluate it.
#pragma once

#include "models/microfacet/masking.h"
#include "models/microfacet/normal_distribution.h"
#include "models/sheen/sheen.h"
#include "models/specular/term.h"

namespace lobefit {

struct SheenAshikhmin : CosineSampling {
  static constexpr ModelInfo info{.name = "sheen_ashikhmin",
                                  .title = "Ashikhmin velvet sheen",
                                  .source = "Ashikhmin, Premoze 2007, Distribution-based BRDFs; Neubelt, Pettineo 2013",
                                  .reciprocal = true,
                                  .energy_conserving = true,
                                  .doc = "d_ashikhmin times vis_cloth."};

  template <class T>
  struct Parameters {
    Vec3<T> color;
    T alpha;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.color, sheen_color_parameter);
    visit(p.alpha, specular_alpha_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    return p.color * (let("d", AshikhminDistribution::at(g, p.alpha)) * let("visibility", ClothVisibility::at(g)));
  }
};

}  // namespace lobefit
