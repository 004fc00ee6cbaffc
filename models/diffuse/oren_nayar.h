// Oren-Nayar, the full functional approximation.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

struct OrenNayar : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "oren_nayar",
      .title = "Oren-Nayar diffuse, full form",
      .source = "Oren, Nayar 1994, Generalization of Lambert's Reflectance Model, equations 27-30",
      .reciprocal = true,
      // Both fail at grazing angles: the fit behind C2 tan B overshoots there.
      .energy_conserving = false,
      .non_negative = false,
      .doc = "Lambertian V-grooves with Gaussian slopes: shadowing, masking and a second bounce."};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T sigma;
    T multiple_scattering;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.sigma, ParameterInfo{.name = "sigma",
                                 .symbol = "σ",
                                 .unit = "rad",
                                 .upper = pi / 2.0,
                                 .initial = 0.3,
                                 .doc = "Standard deviation of the facets' slope angles."});
    visit(p.multiple_scattering, multiple_scattering_parameter);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    // A is the larger polar angle, B the smaller one, c the cosine of the azimuth difference.
    const G cos_a = let("cos_a", min(g.cos_theta_i, g.cos_theta_o));
    const G cos_b = let("cos_b", max(g.cos_theta_i, g.cos_theta_o));
    const G sin_a = let("sin_a", max(g.sin_theta_i, g.sin_theta_o));
    const G sin_b = let("sin_b", min(g.sin_theta_i, g.sin_theta_o));
    const G a = let("a", acos(cos_a));
    const G b = let("b", acos(cos_b));
    const G sines = let("sines", max(sin_a * sin_b, smallest_base));
    const G c = let("c", g.tangential_dot / sines);
    // 1 - |c| = sin²φ/(1 + |c|): multiplied by tan((A + B)/2), the plain difference would show its rounding at grazing.
    const G sin_phi = let("sin_phi", (g.wi.x * g.wo.y - g.wi.y * g.wo.x) / sines);
    const G across = let("across", square(sin_phi) / (1.0 + abs(c)));
    // Both tangents multiply differences that vanish at the horizon. Within 0.006° of it the difference is rounding
    // alone, so the tangents stop growing there.
    constexpr double horizon = 1e-4;
    const G tan_b = let("tan_b", sin_b / max(cos_b, horizon));
    // tan((A + B)/2) as the ratio of sums keeps the half angle out.
    const G tan_half = let("tan_half", (sin_a + sin_b) / max(cos_a + cos_b, horizon));
    const G b_over = let("b_over", 2.0 * b / pi);

    const T s2 = let("s2", p.sigma * p.sigma);
    const T c1 = let("c1", 1.0 - 0.5 * s2 / (s2 + 0.33));
    const T c2 = let("c2", 0.45 * s2 / (s2 + 0.09) * select(c >= 0.0, sin_a, sin_a - b_over * b_over * b_over));
    const T c3 = let("c3", 0.125 * s2 / (s2 + 0.09) * square(4.0 * a * b / (pi * pi)));
    const T single = let("single", c1 + c * c2 * tan_b + across * c3 * tan_half);
    const T twice = let("twice", p.multiple_scattering * (0.17 * s2 / (s2 + 0.13)) * (1.0 - c * square(b_over)));
    return p.albedo / pi * (single + p.albedo * twice);
  }
};

}  // namespace lobefit
