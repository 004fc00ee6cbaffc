// Hammon's diffuse for GGX and Smith.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

struct Hammon : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "hammon",
      .title = "Hammon 2017 diffuse",
      .source = "Hammon 2017, PBR Diffuse Lighting for GGX+Smith Microsurfaces, GDC, slide 113",
      .reciprocal = true,
      .energy_conserving = false,
      .doc = "Closed form fitted to path-traced GGX facets with interreflection."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T alpha;
    T multiple_scattering;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.alpha, alpha_parameter);
    visit(p.multiple_scattering, multiple_scattering_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const G facing = let("facing", 0.5 + 0.5 * g.cos_light_view);
    const G rough =
        let("rough", facing * (0.9 - 0.4 * facing) * ((0.5 + g.cos_theta_h) / max(g.cos_theta_h, smallest_base)));
    const G smooth = let("smooth_term", 1.05 * (1.0 - pow5(1.0 - g.cos_theta_i)) * (1.0 - pow5(1.0 - g.cos_theta_o)));
    const T single = let("single", lerp(smooth, rough, p.alpha) / pi);
    const T multiple = let("multiple", p.multiple_scattering * 0.1159 * p.alpha);
    return p.albedo * (single + p.albedo * multiple);
  }
};

}  // namespace lobefit
