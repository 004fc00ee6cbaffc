#include "reference/substrate/tree_albedo.h"

namespace lobefit {

std::vector<Rgb> closure_albedos(const std::vector<Closure>& closures, const Direction& wo, int steps) {
  std::vector<Rgb> albedos(closures.size(), Rgb{0.0, 0.0, 0.0});
  const double step = 1.0 / steps;
  for (std::size_t k = 0; k < closures.size(); ++k) {
    for (int i = 0; i < steps; ++i) {
      for (int j = 0; j < steps; ++j) {
        const Direction wi = Slab::sample(closures[k].slab, wo, {(i + 0.5) * step, (j + 0.5) * step});
        if (wi.z <= 0.0) continue;
        const double density = Slab::pdf(closures[k].slab, wi, wo);
        if (density <= 0.0) continue;
        albedos[k] = albedos[k] + closures[k].evaluate(wi, wo) * (wi.z * step * step / density);
      }
    }
  }
  return albedos;
}

Rgb directional_albedo(const std::vector<Closure>& closures, const Direction& wo, int steps) {
  Rgb sum{0.0, 0.0, 0.0};
  for (const Rgb& albedo : closure_albedos(closures, wo, steps)) sum = sum + albedo;
  return sum;
}

}  // namespace lobefit
