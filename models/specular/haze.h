// Haze: a sharp lobe within a wide one, both GGX.
#pragma once

#include "models/sampling.h"
#include "models/specular/ggx.h"

namespace lobefit {

/// What Barla et al. make of haziness: the parameters of the two lobes.
///
/// P = (α/α_wide)² is the wide lobe's peak over the narrow one's. Haze of intensity k = weight × reflectance adds
/// (1 - P) k to the reflectance r, while the peak, r - (1 - P) k, stays what f0 says. Both lobes must be positive,
/// P k ≤ f0, and no more light may leave than arrives, r ≤ 1: haziness goes from 0 to the lesser of the two limits.
/// The strongest channel decides; the paper maps the whole Fresnel curve and we, like engines, its start θ_d = 0.
/// Unity's mapping rounds the corner between the limits (at f0 = P) by a rational curve, which we leave out.
template <class T>
struct Haze {
  T wide_alpha;
  T gain;    // reflectance at normal incidence over f0
  T weight;  // of the wide lobe

  LOBEFIT_TEXT Haze(const Vec3<T>& f0, const T& alpha, const T& haziness, const T& extent) {
    wide_alpha = let("wide_alpha", min(alpha * (1.0 + extent), 1.0));
    const T peak_ratio = let("peak_ratio", square(alpha / wide_alpha));
    const T rest = let("rest", max(1.0 - peak_ratio, 0.0));
    const T core = let("core", max(max(max(f0.x, f0.y), f0.z), smallest_core));
    const T most = let("most", min(core / peak_ratio, (1.0 - min(core, 1.0)) / max(rest, 1e-9)));
    const T intensity = let("intensity", haziness * most);
    const T reflectance = let("reflectance", core + rest * intensity);
    gain = let("gain", reflectance / core);
    weight = let("weight", saturate(intensity / reflectance));
  }

  static constexpr double smallest_core = 1e-6;
};

struct SpecularHaze {
  static constexpr ModelInfo info{
      .name = "specular_haze",
      .title = "Hazy gloss, two GGX lobes",
      .source = "Barla, Pacanowski, Vangorp 2018, A Composite BRDF Model for Hazy Gloss",
      .reciprocal = true,
      .energy_conserving = true,
      .doc = "A sharp lobe within a halo. Haziness trades between them at a constant peak: the halo's light is extra."};

  template <class T>
  struct Parameters {
    Vec3<T> f0;
    T alpha, haziness, haze_extent;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    ParameterInfo core = specular_f0_parameter;
    core.doc = "Reflectance at normal incidence that the peak has without haze, linear Rec.709 RGB.";
    visit(p.f0, core);
    ParameterInfo alpha = specular_alpha_parameter;
    alpha.initial = 0.1;
    visit(p.alpha, alpha);
    visit(p.haziness, ParameterInfo{.name = "haziness",
                                    .symbol = "β_h",
                                    .initial = 0.5,
                                    .doc = "Share of the strongest haze that keeps the peak and the energy."});
    visit(p.haze_extent, ParameterInfo{.name = "haze_extent",
                                       .symbol = "λ_h",
                                       .upper = 20.0,
                                       .initial = 3.0,
                                       .doc = "Alpha of the halo: alpha (1 + extent), at most 1."});
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    const Haze<T> haze(p.f0, p.alpha, p.haziness, p.haze_extent);
    const Vec3<T> fresnel =
        let("fresnel", call<SchlickFresnel>(g.cos_theta_d, p.f0 * haze.gain, Vec3<T>{T(1.0), T(1.0), T(1.0)}));
    return fresnel * lerp(let("narrow", ggx_lobe(p.alpha, g)), let("wide", ggx_lobe(haze.wide_alpha, g)), haze.weight);
  }

  /// Both lobes by the facets that wo sees, in their shares.
  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    const Haze<double> haze(p.f0, p.alpha, p.haziness, p.haze_extent);
    std::array<double, 2> rest = u;
    const double alpha = pick_lobe<2>({haze.weight, 1.0 - haze.weight}, rest) == 0 ? haze.wide_alpha : p.alpha;
    return sample_visible_reflection(Distribution::ggx, alpha, wo, rest);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    const Haze<double> haze(p.f0, p.alpha, p.haziness, p.haze_extent);
    return lerp(visible_reflection_density(Distribution::ggx, p.alpha, wi, wo),
                visible_reflection_density(Distribution::ggx, haze.wide_alpha, wi, wo), haze.weight);
  }
};

}  // namespace lobefit
