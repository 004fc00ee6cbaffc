// Burley's diffuse (Disney principled).
#pragma once

#include "models/model.h"

namespace lobefit {

/// 1 + (f90 - 1)(1 - cos θ)⁵.
struct SchlickScale {
  static constexpr const char* name = "schlick_scale";
  static constexpr std::array arguments{"f90", "cos_theta"};

  template <class F, class C>
  LOBEFIT_TEXT static auto evaluate(const F& f90, const C& cos_theta) {
    return 1.0 + (f90 - 1.0) * pow5(1.0 - cos_theta);
  }
};

struct Burley {
  static constexpr ModelInfo info{
      .name = "burley",
      .title = "Burley (Disney) diffuse",
      .source = "Burley 2012, Physically Based Shading at Disney, section 5.3",
      .reciprocal = true,
      .energy_conserving = false,
      .doc = "Two Schlick factors whose grazing value rises with roughness, fitted by eye to MERL."};

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
    const T f90 = let("f90", 0.5 + 2.0 * p.roughness * square(g.cos_theta_d));
    return p.albedo / pi * (call<SchlickScale>(f90, g.cos_theta_i) * call<SchlickScale>(f90, g.cos_theta_o));
  }
};

}  // namespace lobefit
