// Proxima: Callisto's functional approximation of GGX-oriented Lambertian facets.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

/// 1 + α (a + b/μi) (1 - (max(-V·L, 0))^e), Proxima's factor on Lambert.
///
/// The slides print a = -0.55, b = 0.19, e = ½ and advise to multiply by μi before use. For these constants the factor
/// is positive everywhere; for constants fitted to shadowed references, where b < 0, it is not. The slide has no clamp,
/// the port's shader has one (`max(0, bracket)` on the premultiplied form). A least-squares fit sees the difference,
/// so both stand here: `proxima` is the shader's form, `proxima_unclamped` the slide's.
template <class T>
struct ProximaParameters {
  Vec3<T> albedo;
  T alpha;
  T a, b, exponent;
};

/// `fade` is 1 - (max(-V·L, 0))^e.
template <class T, class C, class F, class G>
LOBEFIT_TEXT T proxima_factor(const T& alpha, const C& a, const C& b, const F& fade, const Geometry<G>& g) {
  return 1.0 + alpha * let("slope", a + b / max(g.cos_theta_i, smallest_base)) * fade;
}
template <class T, class G>
LOBEFIT_TEXT T proxima_factor(const ProximaParameters<T>& p, const Geometry<G>& g) {
  const G cos_theta_k = let("cos_theta_k", saturate(-g.cos_light_view));
  const T fade = let("fade", 1.0 - pow(cos_theta_k, p.exponent));
  return proxima_factor(p.alpha, p.a, p.b, fade, g);
}

/// As the slides print it, and the shader clamps it.
inline constexpr double proxima_published_a = -0.55, proxima_published_b = 0.19;
template <class T, class G>
LOBEFIT_TEXT T published_proxima_factor(const T& alpha, const Geometry<G>& g) {
  const G cos_theta_k = let("cos_theta_k", saturate(-g.cos_light_view));
  const G fade = let("fade", 1.0 - sqrt(cos_theta_k));
  return max(proxima_factor(alpha, proxima_published_a, proxima_published_b, fade, g), 0.0);
}

template <class P, class Visit>
constexpr void describe_proxima(P& p, Visit&& visit) {
  visit(p.albedo, albedo_parameter);
  visit(p.alpha, alpha_parameter);
  visit(p.a, ParameterInfo{.name = "a",
                           .lower = -2.0,
                           .upper = 2.0,
                           .initial = proxima_published_a,
                           .tier = Tier::full,
                           .doc = "Constant part of the roughness term."});
  visit(p.b, ParameterInfo{.name = "b",
                           .lower = -2.0,
                           .upper = 2.0,
                           .initial = proxima_published_b,
                           .tier = Tier::full,
                           .doc = "Part of the roughness term that grows as 1/cos theta_i."});
  // Below 0.2 the guarded pow(0, e) would no longer vanish.
  visit(p.exponent, ParameterInfo{.name = "exponent",
                                  .symbol = "e",
                                  .lower = 0.2,
                                  .upper = 16.0,
                                  .initial = 0.5,
                                  .tier = Tier::full,
                                  .doc = "Exponent of the fade in cos theta_k = -dot(V, L)."});
}

struct Proxima : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "proxima",
      .title = "Proxima diffuse (The Callisto Protocol)",
      .source = "Jimenez et al. 2023, The Character Rendering Art of The Callisto Protocol, slides 125-128",
      .reciprocal = false,
      .energy_conserving = false,
      .doc =
          "Lambert plus a term in the light's angle that fades out where light and view oppose each other, clamped at "
          "0."};

  template <class T>
  using Parameters = ProximaParameters<T>;

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_proxima(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    return p.albedo / pi * max(proxima_factor(p, g), 0.0);
  }
};

struct ProximaUnclamped : GrazingSampling {
  static constexpr ModelInfo info{
      .name = "proxima_unclamped",
      .title = "Proxima diffuse, the slide's form without clamp",
      .source = "Jimenez et al. 2023, The Character Rendering Art of The Callisto Protocol, slide 128",
      .reciprocal = false,
      .energy_conserving = false,
      .non_negative = false,
      .doc =
          "As proxima, but negative where its factor is: linear in a and b, so that their fit is plain linear least "
          "squares."};

  template <class T>
  using Parameters = ProximaParameters<T>;

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    describe_proxima(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    return p.albedo / pi * proxima_factor(p, g);
  }
};

}  // namespace lobefit
