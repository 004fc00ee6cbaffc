// Chan's two rough diffuse models.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

struct Chan2018 : CosineSampling {
  static constexpr ModelInfo info{
      .name = "chan_2018",
      .title = "Chan 2018 diffuse (Call of Duty: WWII; Substrate's opaque diffuse)",
      .source = "Chan 2018, Material Advances in Call of Duty: WWII, SIGGRAPH course",
      .reciprocal = true,
      .energy_conserving = false,
      // The bump's quadratic in gloss is negative around gloss 0.8, and nothing clamps it.
      .non_negative = false,
      .doc = "Fit to multiple-scattering GGX diffuse facets, interpolated over gloss; gains energy in the furnace."};

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
    const T alpha = let("alpha", p.roughness * p.roughness);
    // Below alpha = 1e-5 the gloss is saturated at 1 anyway; the guard keeps the logarithm finite.
    const T gloss = let("gloss", saturate(log2(2.0 / max(alpha * alpha, 1e-10) - 1.0) / 18.0));
    const G f0 = let("f0", g.cos_theta_d + pow5(1.0 - g.cos_theta_d));
    const G f1 = let("f1", (1.0 - 0.75 * pow5(1.0 - g.cos_theta_o)) * (1.0 - 0.75 * pow5(1.0 - g.cos_theta_i)));
    const T base = let("base", lerp(f0, f1, saturate(2.2 * gloss - 0.5)));
    const T bump = let("bump", ((34.5 * gloss - 59.0) * gloss + 24.5) * g.cos_theta_d *
                                   exp2(-max(73.2 * gloss - 21.2, 8.9) * sqrt(g.cos_theta_h)));
    return p.albedo / pi * (base + bump);
  }
};

struct Chan2024 : CosineSampling {
  static constexpr ModelInfo info{.name = "chan_2024",
                                  .title = "Chan 2024 diffuse",
                                  .source = "Unpublished; as found in engine sources of 2024",
                                  .reciprocal = true,
                                  .energy_conserving = false,
                                  .doc =
                                      "Half-vector fit to GGX diffuse facets. Its last term, .38 alpha, stands for "
                                      "further bounces but carries no second albedo in engine copies."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T roughness;
    T multiple_scattering;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.roughness, roughness_parameter);
    visit(p.multiple_scattering, multiple_scattering_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const T alpha = let("alpha", p.roughness * p.roughness);
    const T scale = let("scale", max(0.55 - 0.2 * p.roughness, 1.25 - 1.6 * p.roughness));
    const T facing = let("facing", (g.cos_theta_h + saturate(4.0 * alpha)) / (g.cos_theta_h + 0.025));
    const T rough = let("rough", scale * facing * square(g.cos_theta_d));
    return p.albedo / pi * (lerp(1.0, rough, p.roughness) + p.multiple_scattering * 0.38 * alpha);
  }
};

}  // namespace lobefit
