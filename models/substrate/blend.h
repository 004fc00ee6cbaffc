// Two slabs as one: the rules by which a tree is collapsed.
//
// Substrate's own rules are called empirical and not given (S2, slides 57-59: only that a horizontal mix lerps). Two
// sets stand here, one text each for all scalars:
//
//   BaselineBlend   what the slides and the coverage algebra imply
//   FittedBlend     closed forms of what layers do to light, whose constants are fitted to the layered integrator
//                   (`lobefit refit substrate-rules`; docs/substrate_rules.md gives them as formulas)
//
// Both take slabs that are fully there; partial coverage is a mix of the outcomes: see blend_vertical().
#pragma once

#include "models/substrate/diffuse_fresnel.h"
#include "models/substrate/slab.h"

namespace lobefit {

template <class T>
LOBEFIT_TEXT T mean_of_channels(const Vec3<T>& c) {
  return (c.x + c.y + c.z) / 3.0;
}
template <class T, class F>
LOBEFIT_TEXT Vec3<T> each_channel(const Vec3<T>& a, const F& f) {
  return {f(a.x), f(a.y), f(a.z)};
}
template <class T, class F>
LOBEFIT_TEXT Vec3<T> each_channel(const Vec3<T>& a, const Vec3<T>& b, const F& f) {
  return {f(a.x, b.x), f(a.y, b.y), f(a.z, b.z)};
}

template <class T>
LOBEFIT_TEXT Vec3<T> at_most(const Vec3<T>& a, double limit) {
  return each_channel(a, [&](const T& x) { return T(min(x, limit)); });
}

/// Optical depth above which nothing passes: e^-30.
inline constexpr double opaque_depth = 30.0;

/// Of a medium along the normal: thickness over mean free path; opaque_depth where that is 0.
template <class T>
LOBEFIT_TEXT Vec3<T> slab_depth(const Slab::Parameters<T>& slab) {
  return each_channel(slab.mean_free_path, [&](const T& mfp) {
    return T(select(mfp > 0.0, min(slab.thickness / max(mfp, 1e-9), opaque_depth), T(opaque_depth)));
  });
}

/// The mean free path that gives a depth over a thickness; 0, opaque, from opaque_depth on.
template <class T>
LOBEFIT_TEXT Vec3<T> mean_free_path_of_depth(const Vec3<T>& depth, const T& thickness) {
  return each_channel(depth, [&](const T& d) {
    return T(select(d < 0.999 * opaque_depth, max(thickness, 1e-6) / max(d, 1e-9), T(0.0)));
  });
}

/// Both lobes of a slab as one alpha, in their shares.
template <class T>
LOBEFIT_TEXT T slab_alpha(const Slab::Parameters<T>& slab) {
  return lerp(T(square(slab.roughness)), T(square(slab.second_roughness)), slab.second_roughness_weight);
}

/// Everything of two slabs in the proportion 1 - t : t.
template <class T>
LOBEFIT_TEXT Slab::Parameters<T> lerp_slabs(const Slab::Parameters<T>& a, const Slab::Parameters<T>& b, const T& t) {
  Slab::Parameters<T> result = a;
  result.diffuse_albedo = lerp(a.diffuse_albedo, b.diffuse_albedo, t);
  result.f0 = lerp(a.f0, b.f0, t);
  result.f90 = lerp(a.f90, b.f90, t);
  result.roughness = lerp(a.roughness, b.roughness, t);
  result.anisotropy = lerp(a.anisotropy, b.anisotropy, t);
  // A slab without a second lobe has no roughness for it.
  const T second = let("second", lerp(a.second_roughness_weight, b.second_roughness_weight, t));
  result.second_roughness = select(second > 0.0,
                                   (a.second_roughness * a.second_roughness_weight * (1.0 - t) +
                                    b.second_roughness * b.second_roughness_weight * t) /
                                       max(second, 1e-9),
                                   a.second_roughness);
  result.second_roughness_weight = second;
  const T fuzz = let("fuzz", lerp(a.fuzz_amount, b.fuzz_amount, t));
  const T fuzz_share = let("fuzz_share", b.fuzz_amount * t / max(fuzz, 1e-9));
  result.fuzz_color = lerp(a.fuzz_color, b.fuzz_color, fuzz_share);
  result.fuzz_roughness = lerp(a.fuzz_roughness, b.fuzz_roughness, fuzz_share);
  result.fuzz_amount = fuzz;
  result.phase_anisotropy = lerp(a.phase_anisotropy, b.phase_anisotropy, t);
  result.thickness = lerp(a.thickness, b.thickness, t);
  result.emissive = lerp(a.emissive, b.emissive, t);
  // Of transmittances the mean; a mean free path has none.
  Vec3<T> depth = each_channel(slab_depth(a), slab_depth(b), [&](const T& da, const T& db) {
    return T(min(-log(lerp(T(exp(-da)), T(exp(-db)), t)), opaque_depth));
  });
  result.mean_free_path = mean_free_path_of_depth(depth, result.thickness);
  result.glint_density = lerp(a.glint_density, b.glint_density, t);
  return result;
}

/// What the slides say of mixes, and what the coverage algebra implies of layers: the bottom's diffuse albedo and F0
/// times what reaches it, added to the top's; the rest in the share of light that reaches the bottom.
struct BaselineBlend {
  template <class T>
  struct Constants {};

  template <class T>
  LOBEFIT_TEXT static Slab::Parameters<T> horizontal(const Slab::Parameters<T>& background,
                                                     const Slab::Parameters<T>& foreground, const T& mix,
                                                     const Constants<T>& = {}) {
    return lerp_slabs(background, foreground, mix);
  }

  template <class T>
  LOBEFIT_TEXT static Slab::Parameters<T> vertical(const Slab::Parameters<T>& top, const Slab::Parameters<T>& bottom,
                                                   const Constants<T>& = {}) {
    Vec3<T> passed = each_channel(slab_depth(top), [](const T& depth) { return T(exp(-depth)); });
    Vec3<T> reach = (1.0 - top.f0) * passed * passed;
    const T share = let("share", saturate(mean_of_channels(reach)));
    Slab::Parameters<T> result = lerp_slabs(top, bottom, share);
    // A medium's albedo is that of an infinite depth: what it stops is its share here.
    result.diffuse_albedo = at_most(top.diffuse_albedo * (1.0 - passed) + bottom.diffuse_albedo * reach, 1.0);
    result.f0 = at_most(top.f0 + bottom.f0 * reach, 1.0);
    result.fuzz_amount = top.fuzz_amount;
    result.fuzz_color = top.fuzz_color;
    result.fuzz_roughness = top.fuzz_roughness;
    Vec3<T> depth = at_most(slab_depth(top) + slab_depth(bottom), opaque_depth);
    result.thickness = top.thickness + bottom.thickness;
    result.mean_free_path = mean_free_path_of_depth(depth, result.thickness);
    result.diffuse_model = bottom.diffuse_model;
    return result;
  }
};

/// A medium between two streams of diffuse light (Kubelka, Munk 1931).
template <class T>
struct TwoStreams {
  T reflected, passed;

  /// `absorbed`, `scattered`: K and S times the thickness.
  LOBEFIT_TEXT static TwoStreams of(const T& absorbed, const T& scattered) {
    const T sum = let("sum", absorbed + scattered);
    const T root = let("root", sqrt(absorbed * (absorbed + 2.0 * scattered) + 1e-8));
    const T decay = let("decay", exp(-root));
    const T scale = let("scale", 1.0 / (root + sum + (root - sum) * decay * decay));
    return {scattered * (1.0 - decay * decay) * scale, 2.0 * root * decay * scale};
  }
  /// Over a bottom of this albedo.
  LOBEFIT_TEXT T over(const T& albedo) const {
    return reflected + passed * passed * albedo / (1.0 - min(reflected * albedo, 0.9999));
  }
};

/// What a compensated lobe of this f0 reflects on the whole, E (f0 + f0² (1 - E)/E), and the f0 that gives a
/// reflectance.
template <class T>
LOBEFIT_TEXT Vec3<T> with_further_bounces(const Vec3<T>& f0, const T& albedo) {
  return f0 * (albedo + f0 * (1.0 - albedo));
}
template <class T>
LOBEFIT_TEXT Vec3<T> without_further_bounces(const Vec3<T>& reflectance, const T& albedo) {
  return each_channel(reflectance, [&](const T& r) {
    return T(2.0 * r / (albedo + sqrt(albedo * albedo + 4.0 * (1.0 - albedo) * r)));
  });
}

/// Closed forms with fitted constants.
///
/// Vertical, per channel, with n the index of the top's mean F0, τ its depth, ω its single-scattering albedo:
///
///   ρ̂ = ρ/((1 - F_b) + F_b ρ)                         the bottom's body under an interface of its own, F_b
///   R(p) = R_km + T_km² ρ'/(1 - R_km ρ')               through the medium (Kubelka-Munk), K = p (1 - ω')τ', S = s ω'
///   τ',
///                                                      τ' = τ (1 - ω g), ω' = ω (1 - g)/(1 - ω g); ρ' = ρ̂ + F_r
///   ρ_out = (1 - F_i) R(p_out)/(1 - F_i R(p_inside))   Saunderson: F_i what the top's interface sends back inside
///   F_out = (1 - F_t)(1 - F_x) F_r T²/(1 - F_x F_r T²) the bottom's lobe through the top
///
/// and the lobes' alphas meet in a power mean weighted by their light, or stay apart as two lobes. F_r is the bottom's
/// reflectance seen from inside the top: of two dielectrics, that of their relative index.
struct FittedBlend {
  template <class T>
  struct Constants {
    T path_out, path_inside, scattering, forward, rough_interior, trapping, top_trapping, stretch, blur, layer_power,
        mix_power, body_gain, body_gain_slope;
  };

  /// Names, starting values (what smooth optics or plain averaging would have) and bounds.
  template <class C, class Visit>
  static constexpr void describe(C& c, Visit&& visit) {
    visit(c.path_out,
          ParameterInfo{.name = "path_out",
                        .symbol = "p_out",
                        .lower = 0.5,
                        .upper = 3.0,
                        .initial = 1.1,
                        .doc = "Path through the medium of light that leaves, over the thickness, one way"});
    visit(c.path_inside, ParameterInfo{.name = "path_inside",
                                       .symbol = "p_in",
                                       .lower = 0.5,
                                       .upper = 5.0,
                                       .initial = 1.8,
                                       .doc = "the same of light that the interface sends back inside"});
    visit(c.scattering, ParameterInfo{.name = "scattering",
                                      .symbol = "s",
                                      .lower = 0.05,
                                      .upper = 3.0,
                                      .initial = 0.75,
                                      .doc = "Kubelka and Munk's S over ω' τ'"});
    visit(c.forward, ParameterInfo{.name = "forward",
                                   .symbol = "w",
                                   .lower = 0.0,
                                   .upper = 1.0,
                                   .initial = 0.0,
                                   .doc = "share of scattered light that stays in the bottom's lobe"});
    visit(c.rough_interior, ParameterInfo{.name = "rough_interior",
                                          .symbol = "q",
                                          .lower = -1.0,
                                          .upper = 1.0,
                                          .initial = 0.0,
                                          .doc = "loss of F_i with the top's alpha"});
    visit(c.trapping, ParameterInfo{.name = "trapping",
                                    .symbol = "h",
                                    .lower = 0.0,
                                    .upper = 20.0,
                                    .initial = 2.0,
                                    .doc = "how fast F_x goes from F_t to F_i with the bottom's alpha"});
    visit(c.top_trapping, ParameterInfo{.name = "top_trapping",
                                        .symbol = "h_t",
                                        .lower = 0.0,
                                        .upper = 20.0,
                                        .initial = 0.5,
                                        .doc = "the same with the top's alpha"});
    visit(c.stretch, ParameterInfo{.name = "stretch",
                                   .symbol = "e",
                                   .lower = -1.0,
                                   .upper = 3.0,
                                   .initial = 1.0,
                                   .doc = "exponent of n by which refraction widens the bottom's lobe"});
    visit(c.blur, ParameterInfo{.name = "blur",
                                .symbol = "b",
                                .lower = 0.0,
                                .upper = 4.0,
                                .initial = 0.7,
                                .doc = "alpha that the bottom's lobe gains, over (n - 1) times the top's"});
    visit(c.layer_power, ParameterInfo{.name = "layer_power",
                                       .symbol = "m_v",
                                       .lower = -3.0,
                                       .upper = 3.0,
                                       .initial = 1.0,
                                       .doc = "power of the mean of two layers' alphas"});
    visit(c.mix_power, ParameterInfo{.name = "mix_power",
                                     .symbol = "m_h",
                                     .lower = -3.0,
                                     .upper = 3.0,
                                     .initial = 1.0,
                                     .doc = "power of the mean of two mixed alphas"});
    visit(c.body_gain, ParameterInfo{.name = "body_gain",
                                     .symbol = "G_0",
                                     .lower = 0.8,
                                     .upper = 1.3,
                                     .initial = 1.0,
                                     .doc = "what the collapsed body's diffuse model must be given, at roughness 0"});
    visit(c.body_gain_slope, ParameterInfo{.name = "body_gain_slope",
                                           .symbol = "G_1",
                                           .lower = -0.5,
                                           .upper = 0.5,
                                           .initial = 0.0,
                                           .doc = "and its slope over roughness"});
  }

  static Constants<double> initial() {
    Constants<double> constants{};
    describe(constants, [](double& member, const ParameterInfo& info) { member = info.initial; });
    return constants;
  }

  /// Two lobes kept apart instead of averaged.
  template <bool haze, class T>
  LOBEFIT_TEXT static void merge_lobes(Slab::Parameters<T>& result, const T& alpha_a, const T& light_a,
                                       const T& alpha_b, const T& light_b, const T& power) {
    const T share = let("share", light_b / max(light_a + light_b, 1e-9));
    const T a = let("a", max(alpha_a, 1e-4)), b = let("b", max(alpha_b, 1e-4));
    if constexpr (haze) {
      result.roughness = sqrt(a);
      result.second_roughness = sqrt(b);
      result.second_roughness_weight = share;
    } else {
      // x^m to the first order in m at m = 0, where the mean is geometric.
      const T m = let("m", select(abs(power) < 1e-3, T(1e-3), power));
      result.roughness = sqrt(min(pow(lerp(T(pow(a, m)), T(pow(b, m)), share), T(1.0 / m)), 1.0));
      result.second_roughness_weight = T(0.0);
    }
  }

  /// The slab's body is seen through 1 - F0 of the mixture, where each had its own: undone here.
  template <bool haze = false, class T>
  LOBEFIT_TEXT static Slab::Parameters<T> horizontal(const Slab::Parameters<T>& background,
                                                     const Slab::Parameters<T>& foreground, const T& mix,
                                                     const Constants<T>& c) {
    Slab::Parameters<T> result = lerp_slabs(background, foreground, mix);
    Vec3<T> body =
        lerp(background.diffuse_albedo * (1.0 - background.f0), foreground.diffuse_albedo * (1.0 - foreground.f0), mix);
    result.diffuse_albedo = at_most(body / max(1.0 - result.f0, 0.02), 1.0);
    const T light_a = let("light_a", (1.0 - mix) * mean_of_channels(background.f0));
    const T light_b = let("light_b", mix * mean_of_channels(foreground.f0));
    const T share = let("share_b", light_b / max(light_a + light_b, 1e-9));
    result.f90 = lerp(background.f90, foreground.f90, share);
    result.anisotropy = lerp(background.anisotropy, foreground.anisotropy, share);
    merge_lobes<haze>(result, slab_alpha(background), light_a, slab_alpha(foreground), light_b, c.mix_power);
    return result;
  }

  template <bool haze = false, class T>
  LOBEFIT_TEXT static Slab::Parameters<T> vertical(const Slab::Parameters<T>& top, const Slab::Parameters<T>& bottom,
                                                   const Constants<T>& c) {
    const auto index_of = [](const T& f0) {
      const T root = sqrt(min(f0, 0.9));
      return T((1.0 + root) / (1.0 - root));
    };
    const T f0 = let("f0", mean_of_channels(top.f0));
    const T bottom_f0 = let("bottom_f0", mean_of_channels(bottom.f0));
    const T n = let("n", index_of(f0));
    const T metal = let("metal", saturate((bottom_f0 - 0.08) / 0.12));
    const T bottom_n = let("bottom_n", index_of(T(bottom_f0 * (1.0 - metal))));
    const T alpha = let("alpha", slab_alpha(top)), bottom_alpha = let("bottom_alpha", slab_alpha(bottom));

    // What the bottom is from inside the top.
    const T own_inside = let("own_inside", diffuse_fresnel_inside(bottom_n));
    const T inside = let("inside", diffuse_fresnel_inside(T(max(n, bottom_n))) * (1.0 - c.rough_interior * alpha));
    const T relative = let("relative", square((bottom_n - n) / (bottom_n + n)));
    // f0 = 0 is no interface, not one of index 1.
    const T between = let("between", select(bottom_f0 > 0.0, relative, T(0.0)));
    const T bottom_keeps = let("bottom_keeps", 1.0 - call<GgxAverageLoss>(bottom_alpha));
    Vec3<T> reflectance = with_further_bounces(Vec3<T>(bottom.f0 * metal + between * (1.0 - metal)), bottom_keeps);
    Vec3<T> body = bottom.diffuse_albedo / ((1.0 - own_inside) + own_inside * bottom.diffuse_albedo);

    // The medium.
    Vec3<T> depth = slab_depth(top);
    Vec3<T> scattering = single_scattering_albedo(top.diffuse_albedo, top.phase_anisotropy);
    const auto through = [&](const T& tau, const T& omega, const T& albedo, const T& path) {
      const T left = T(1.0 - omega * top.phase_anisotropy);
      const T reduced = tau * left, reduced_omega = omega * (1.0 - top.phase_anisotropy) / max(left, 1e-6);
      return TwoStreams<T>::of(T(path * (1.0 - reduced_omega) * reduced), T(c.scattering * reduced_omega * reduced))
          .over(albedo);
    };
    const auto channel = [&](const T& tau, const T& omega, const T& albedo, const T& f, T& specular, T& diffuse) {
      const T direct = exp(-2.0 * c.path_out * tau * (1.0 - c.forward * omega));
      const T crossed = lerp(f0, inside, T(1.0 - exp(-(c.trapping * bottom_alpha + c.top_trapping * alpha))));
      specular = (1.0 - f0) * (1.0 - crossed) * f * direct / (1.0 - min(crossed * f * direct, 0.9999));
      const T both = min(albedo + f, 0.9999);
      const T out = max(through(tau, omega, both, c.path_out) - f * direct, 0.0);
      const T back = through(tau, omega, both, c.path_inside);
      diffuse = (1.0 - inside) * out / (1.0 - min(inside * back, 0.9999));
    };
    Vec3<T> specular, diffuse;
    channel(depth.x, scattering.x, body.x, reflectance.x, specular.x, diffuse.x);
    channel(depth.y, scattering.y, body.y, reflectance.y, specular.y, diffuse.y);
    channel(depth.z, scattering.z, body.z, reflectance.z, specular.z, diffuse.z);

    const T light = let("light", mean_of_channels(specular));
    const T share = let("share", light / max(light + f0, 1e-6));
    Slab::Parameters<T> result = lerp_slabs(top, bottom, share);
    result.f90 = lerp(top.f90, bottom.f90, share);
    const T wide = c.stretch * log(n);
    const T blurred = sqrt(square(bottom_alpha * exp(wide)) + square(c.blur * (n - 1.0) * alpha));
    merge_lobes<haze>(result, alpha, f0, T(min(blurred, 1.0)), light, c.layer_power);
    const T keeps = let("keeps", 1.0 - call<GgxAverageLoss>(slab_alpha(result)));
    result.f0 = without_further_bounces(at_most(top.f0 + specular, 1.0), keeps);
    const T gain = let("gain", c.body_gain + c.body_gain_slope * result.roughness);
    result.diffuse_albedo = at_most(diffuse * ((1.0 - f0) * gain) / max(1.0 - result.f0, 0.02), 1.0);

    // Fibres: those on top, or those that reach through a top without an interface.
    const T open = let("open", saturate(1.0 - 50.0 * f0) * exp(-2.0 * mean_of_channels(depth)));
    const T fuzz = let("fuzz", top.fuzz_amount + (1.0 - top.fuzz_amount) * open * bottom.fuzz_amount);
    const T fuzz_share = let("fuzz_share", 1.0 - top.fuzz_amount / max(fuzz, 1e-9));
    result.fuzz_color = lerp(top.fuzz_color, bottom.fuzz_color, fuzz_share);
    result.fuzz_roughness = lerp(top.fuzz_roughness, bottom.fuzz_roughness, fuzz_share);
    result.fuzz_amount = saturate(fuzz);

    Vec3<T> both_depths = at_most(depth + slab_depth(bottom), opaque_depth);
    result.thickness = top.thickness + bottom.thickness;
    result.mean_free_path = mean_free_path_of_depth(both_depths, result.thickness);
    result.diffuse_model = bottom.diffuse_model;
    return result;
  }
};

}  // namespace lobefit
