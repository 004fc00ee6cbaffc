// Lambert: f = ρ/π.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

struct Lambert : CosineSampling {
  static constexpr ModelInfo info{.name = "lambert",
                                  .title = "Lambert diffuse",
                                  .source = "Lambert 1760, Photometria",
                                  .reciprocal = true,
                                  .energy_conserving = true,
                                  .doc = "Constant radiance in every direction."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>&) {
    return p.albedo / pi;
  }
};

}  // namespace lobefit
