// Burley's diffuse (Disney principled).
#pragma once

#include "models/model.h"
#include "models/sampling.h"

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

/// π f/ρ of Burley's diffuse: ½ at grazing angles when smooth, more than 1 towards the light when rough.
struct BurleyFactor {
  static constexpr const char* name = "burley_factor";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "cos_theta_d", "roughness"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const G& cos_theta_d,
                                    const T& roughness) {
    const auto f90 = let("f90", 0.5 + 2.0 * roughness * square(cos_theta_d));
    return call<SchlickScale>(f90, cos_theta_i) * call<SchlickScale>(f90, cos_theta_o);
  }
};

struct Burley : CosineSampling {
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
    return p.albedo / pi * call<BurleyFactor>(g.cos_theta_i, g.cos_theta_o, g.cos_theta_d, p.roughness);
  }
};

}  // namespace lobefit
