// Disney's approximation of subsurface scattering in flat materials.
#pragma once

#include "models/diffuse/burley.h"
#include "models/sampling.h"

namespace lobefit {

/// π f/ρ of it.
struct DisneySubsurfaceFactor {
  static constexpr const char* name = "disney_subsurface_factor";
  static constexpr std::array arguments{"cos_theta_i", "cos_theta_o", "cos_theta_d", "roughness"};

  template <class G, class T>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_i, const G& cos_theta_o, const G& cos_theta_d,
                                    const T& roughness) {
    // L·H, as in disney.brdf (Fss90 = LdotH*LdotH*roughness). Transcriptions with N·H exist; with it Fss90 would no
    // longer be Burley's retro-reflective part ("used to flatten retroreflection based on roughness").
    const auto f90 = let("f90", roughness * square(cos_theta_d));
    const auto schlick = let("schlick", call<SchlickScale>(f90, cos_theta_i) * call<SchlickScale>(f90, cos_theta_o));
    const auto lommel_seeliger = let("lommel_seeliger", 1.0 / max(cos_theta_i + cos_theta_o, smallest_base));
    return 1.25 * (schlick * (lommel_seeliger - 0.5) + 0.5);
  }
};

struct DisneySubsurface : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "disney_subsurface",
      .title = "Disney subsurface (Hanrahan-Krueger shaped) diffuse",
      .source = "Burley 2012, Physically Based Shading at Disney, section 5.3, and Disney's disney.brdf",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "What Disney's BRDF blends its diffuse term into by `subsurface`: a Lommel-Seeliger term 1/(N.L + N.V) "
          "under two Schlick factors, after Hanrahan and Krueger. The albedo reaches 1.51 at the horizon (roughness "
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
    return p.albedo / pi * call<DisneySubsurfaceFactor>(g.cos_theta_i, g.cos_theta_o, g.cos_theta_d, p.roughness);
  }
};

}  // namespace lobefit
