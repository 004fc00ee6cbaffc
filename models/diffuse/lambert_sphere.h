// d'Eon's BRDF of a half space of Lambertian spheres.
#pragma once

#include "models/diffuse/one_minus_power.h"
#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

/// Single-scattering albedo c that is to give the half space the mean albedo ρ (d'Eon 2021, equation 46). In random
/// walks it does up to ρ = ½; above, the mean is larger: .835 for .8, .975 for .95 (tests/diffuse_test.cpp).
struct LambertSphereAlbedo {
  static constexpr const char* name = "lambert_sphere_albedo";
  static constexpr std::array arguments{"albedo"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& albedo) {
    const T lost = let("lost", 1.0 - albedo);
    return call<OneMinusPower>(albedo, T(2.73556)) / (1.0 - 0.184096 * pow(lost, 2.48423));
  }
};

/// A Lambertian sphere's phase function p(u) = 2 (√(1 - u²) - u arccos u)/(3π²), u the cosine of the deflection
/// (Lambert 1760; Blinn 1982), as a function of 1 - u.
struct LambertSpherePhase {
  static constexpr const char* name = "lambert_sphere_phase";
  static constexpr std::array arguments{"one_minus_u"};

  template <class G>
  LOBEFIT_TEXT static G evaluate(const G& one_minus_u) {
    const G d = let("d", one_minus_u);
    // √(1 - u²) - u arccos u is the integral of arccos(1 - t) from 0 to d. The difference loses all its digits next to
    // d = 0; integrated term by term, the arccosine's series does not.
    const G d2 = let("d2", d * d);
    const G low = let(
        "low", 0.6666666666666667 + d * 0.03333333333333333 + d2 * (0.005357142857142857 + d * 0.001240079365079365));
    const G high = let("high", 3.452493686868687e-4 + d * 1.075584571678322e-4 +
                                   d2 * (3.615159254807692e-5 + d * 1.283533432904412e-5));
    const G forward = let("forward", sqrt(2.0 * d) * d * (low + d2 * d2 * high));
    const G elsewhere = let("elsewhere", sqrt(d * (2.0 - d)) - (1.0 - d) * acos(1.0 - d));
    return (2.0 / (3.0 * pi * pi)) * select(d < 0.05, forward, elsewhere);
  }
};

struct LambertSphere : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "lambert_sphere",
      .title = "Lambert-sphere diffuse, fast form",
      .source = "d'Eon 2021, An Analytic BRDF for Materials with Spherical Lambertian Scatterers, equations 46 and 48",
      .reciprocal = true,
      .energy_conserving = false,
      .doc =
          "A half space of sparse Lambertian spheres: exact single scattering and a fit to the rest, which gains "
          "energy with albedos above 0.9: the mean albedo is 1.015 for 0.95 and 1.08 for 1, and the directional one "
          "reaches 1.27."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const Vec3<T> c = let("c", Vec3<T>{call<LambertSphereAlbedo>(p.albedo.x), call<LambertSphereAlbedo>(p.albedo.y),
                                       call<LambertSphereAlbedo>(p.albedo.z)});
    // Light travels along -wi, so u = -L·V, and 1 - u = |wi + wo|²/2 for unit vectors.
    const Vec3<G> sum = let("sum", g.wi + g.wo);
    const G phase = let("phase", call<LambertSpherePhase>(min(0.5 * dot(sum, sum), 2.0)));
    const G single = let("single", phase / max(g.cos_theta_i + g.cos_theta_o, smallest_base));

    // The rest is brightest away from the light: φ, as here, is 0 on the retro side. Neither reciprocity nor the mean
    // albedo can tell this from π - φ (the term is even in φ, and the mean of both over the circle is π/2); d'Eon's own
    // code and random walks can, see tests/diffuse_test.cpp.
    const G sines = let("sines", g.sin_theta_i * g.sin_theta_o);
    const G guarded = let("guarded", max(sines, smallest_base));
    const G cos_phi = let("cos_phi", g.tangential_dot / guarded);
    const G sin_phi = let("sin_phi", abs(g.wi.x * g.wo.y - g.wi.y * g.wo.x) / guarded);
    // Each angle from the smaller of its sine and cosine, where the arccosine is well conditioned.
    const G from_sine = let("from_sine", acos(sin_phi));
    const G phi =
        let("phi", select(abs(cos_phi) < 0.7, acos(cos_phi), 0.5 * pi + select(cos_phi > 0.0, -from_sine, from_sine)));
    const G i2 = let("i2", g.cos_theta_i * g.cos_theta_i);
    const G o2 = let("o2", g.cos_theta_o * g.cos_theta_o);
    const G acos_sines = let("acos_sines", select(sines < 0.7, acos(sines), 0.5 * pi - acos(sqrt(i2 + o2 - i2 * o2))));
    // Multiplied through by the sines, which vanish at the normal.
    const G slope = let("slope", sines * (phi + sqrt(g.cos_theta_i * g.cos_theta_o)) / (0.113706 * sines + acos_sines));

    // d'Eon's own code has .995917 c in place of c in the first term, and -.249978 for the paper's -.24998.
    const Vec3<T> base =
        let("base", Vec3<T>{pow(p.albedo.x, 1.85432), pow(p.albedo.y, 1.85432), pow(p.albedo.z, 1.85432)});
    return max(c * single + base * 0.234459 + (c - 0.24998) * (0.0151829 * slope), 0.0);
  }
};

}  // namespace lobefit
