// Frostbite's renormalised Burley diffuse.
#pragma once

#include "models/diffuse/burley.h"
#include "models/sampling.h"

namespace lobefit {

struct FrostbiteBurley : CosineSampling {
  static constexpr ModelInfo info{
      .name = "frostbite_burley",
      .title = "Frostbite's renormalised Burley diffuse",
      .source =
          "Lagarde, de Rousiers 2014, Moving Frostbite to Physically Based Rendering 3.0, section 3.1.2, listing 1",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "Burley's diffuse with a lower grazing value and a factor that falls to 1/1.51 with roughness, so that "
          "with a specular lobe on top the albedo stays near 1. Alone it reaches 1.006 at the horizon (roughness "
          "1)."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T roughness;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.roughness, roughness_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T energy_bias = let("energy_bias", lerp(0.0, 0.5, p.roughness));
    const T energy_factor = let("energy_factor", lerp(1.0, 1.0 / 1.51, p.roughness));
    const T f90 = let("f90", energy_bias + 2.0 * p.roughness * square(g.cos_theta_d));
    return p.albedo / pi *
           (energy_factor * call<SchlickScale>(f90, g.cos_theta_i) * call<SchlickScale>(f90, g.cos_theta_o));
  }
};

}  // namespace lobefit
