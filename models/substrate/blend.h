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

#include "models/energy/chan_albedo.h"
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
  // Their sum, where a lerp would lose the little that is left of one.
  const T second_a = let("second_a", a.second_roughness_weight * (1.0 - t));
  const T second_b = let("second_b", b.second_roughness_weight * t);
  const T second = let("second", second_a + second_b);
  result.second_roughness =
      select(second > 0.0, (a.second_roughness * second_a + b.second_roughness * second_b) / max(second, 1e-9),
             a.second_roughness);
  result.second_roughness_weight = second;
  const T fuzz = let("fuzz", lerp(a.fuzz_amount, b.fuzz_amount, t));
  const T fuzz_share = let("fuzz_share", b.fuzz_amount * t / max(fuzz, 1e-9));
  result.fuzz_color = lerp(a.fuzz_color, b.fuzz_color, fuzz_share);
  result.fuzz_roughness = lerp(a.fuzz_roughness, b.fuzz_roughness, fuzz_share);
  result.fuzz_amount = fuzz;
  result.phase_anisotropy = lerp(a.phase_anisotropy, b.phase_anisotropy, t);
  result.thickness = lerp(a.thickness, b.thickness, t);
  result.specular_tint = lerp(a.specular_tint, b.specular_tint, t);
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
    // 1 - decay², whose digits float would lose where little is absorbed.
    const T lost = let("lost", 2.0 * root * (1.0 + decay * decay) / (2.0 + call<CothExcess>(T(2.0 * root))));
    const T scale = let("scale", 1.0 / (root * (1.0 + decay * decay) + sum * lost));
    return {scattered * lost * scale, 2.0 * root * decay * scale};
  }
  /// Over a bottom of this albedo.
  LOBEFIT_TEXT T over(const T& albedo) const {
    return reflected + passed * passed * albedo / (1.0 - min(reflected * albedo, 0.9999));
  }
};

/// The two as one function of the shader.
struct TwoStreamsOver {
  static constexpr const char* name = "two_streams_over";
  static constexpr std::array arguments{"absorbed", "scattered", "albedo"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& absorbed, const T& scattered, const T& albedo) {
    return TwoStreams<T>::of(absorbed, scattered).over(albedo);
  }
};

/// The f0 with which a compensated lobe, E and E times Schlick's mean weight at the view being `albedo`'s, reflects
/// `specular`: (f0 (E - G) + G)(1 + f0 (1 - E)/E) solved for f0, f90 being 1.
template <class T>
LOBEFIT_TEXT Vec3<T> f0_of_albedo(const Vec3<T>& specular, const LobeAlbedo<T>& albedo) {
  const T lost = let("lost_ratio", (1.0 - albedo.all) / albedo.all);
  const T a = let("quadratic_a", (albedo.all - albedo.grazing) * lost);
  const T b = let("quadratic_b", albedo.all - albedo.grazing + albedo.grazing * lost);
  return each_channel(specular, [&](const T& r) {
    const T rest = max(r - albedo.grazing, 0.0);
    const T solution = 2.0 * rest / (b + sqrt(b * b + 4.0 * a * rest));
    // Below f0 = .02 grazing reflection fades out (SlabGrazingReflectance): there f0 stands for the whole of it.
    const T faded = 0.02 * saturate(r / (albedo.grazing + 0.02 * (albedo.all - albedo.grazing)));
    return T(min(max(solution, faded), 1.0));
  });
}

/// What becomes of two slabs' lobes: their mean alpha, both (a second lobe), or one of them alone with all the light.
enum class LobeMerge { mean, both, first, second };

/// Closed forms with fitted constants, at a view: a material is shaded where the view is known, so that what is stored
/// may depend on it, as the walk's throughputs do. Where no view is known (a ray's payload) take mean_view.
///
/// Vertical, per channel, with n the index of the top's mean F0, τ its depth, ω its single-scattering albedo, v =
/// 1/μ' the path of the view inside it, over the thickness:
///
///   ρ_b = ρ/((1 - F_b) + F_b ρ)                        the bottom's body under an interface of its own, F_b
///   ρ̂ = (1 - F_d)(1 - F_u) ρ_b/(1 - F_u ρ_b) + F_d     and under that between the two slabs, from above and below
///   R(p) = R_km + T_km² ρ'/(1 - R_km ρ')               through the medium (Kubelka-Munk), K = p (1 - ω')τ', S = s ω'
///   τ',
///                                                      τ' = τ (1 - ω g), ω' = ω (1 - g)/(1 - ω g); ρ' = ρ̂ + F_r
///   body = (1 - E_t)(1 - F_i) R(p)/(1 - F_i R(p_in))    Saunderson: F_i what the top sends back inside;
///                                                      p from (v + p_l)/2 where it absorbs to p_m where it scatters
///   lobe = (1 - E_t)(1 - F_x) F_r T/(1 - F_x F_r T)    the bottom's through the top, T = exp(-τ (v + p)), p from v to
///                                                      p_s with both alphas; F_x from F_t to F_i with them
///
/// E_t is the top's albedo at the view; F_r the bottom's reflectance seen from inside the top: of two dielectrics, that
/// of their relative index. The slab gets the f0 and the diffuse albedo with which it returns E_t + lobe and body at
/// this view; the lobes' alphas meet in a power mean weighted by their light, or stay apart as two lobes.
struct FittedBlend {
  template <class T>
  struct Constants {
    T light_path, lobe_path, milky_path, inside_path, scattering, rough_interior, rough_fresnel, trapping, top_trapping,
        stretch, blur, layer_power, mix_power;
  };

  /// Names, starting values (what smooth optics or plain averaging would have) and bounds.
  template <class C, class Visit>
  static constexpr void describe(C& c, Visit&& visit) {
    visit(c.light_path,
          ParameterInfo{.name = "light_path",
                        .symbol = "p_l",
                        .lower = 0.5,
                        .upper = 3.0,
                        .initial = 1.2,
                        .doc = "path through the medium of light that comes to a body, over the thickness"});
    visit(c.lobe_path, ParameterInfo{.name = "lobe_path",
                                     .symbol = "p_s",
                                     .lower = 0.5,
                                     .upper = 5.0,
                                     .initial = 1.2,
                                     .doc = "the same of light on its way to a rough bottom's lobe"});
    visit(c.milky_path, ParameterInfo{.name = "milky_path",
                                      .symbol = "p_m",
                                      .lower = 0.5,
                                      .upper = 5.0,
                                      .initial = 1.5,
                                      .doc = "the same, one way, of all light in a medium that only scatters"});
    visit(c.inside_path,
          ParameterInfo{.name = "inside_path",
                        .symbol = "p_in",
                        .lower = 0.5,
                        .upper = 5.0,
                        .initial = 1.8,
                        .doc = "path of light that the interface sends back inside, over the thickness, one way"});
    visit(c.scattering, ParameterInfo{.name = "scattering",
                                      .symbol = "s",
                                      .lower = 0.05,
                                      .upper = 3.0,
                                      .initial = 0.75,
                                      .doc = "Kubelka and Munk's S over ω' τ'"});
    visit(c.rough_interior, ParameterInfo{.name = "rough_interior",
                                          .symbol = "q",
                                          .lower = -1.0,
                                          .upper = 1.0,
                                          .initial = 0.0,
                                          .doc = "loss of F_i with the top's alpha"});
    visit(c.rough_fresnel,
          ParameterInfo{.name = "rough_fresnel",
                        .symbol = "k",
                        .lower = 0.0,
                        .upper = 50.0,
                        .initial = 3.0,
                        .doc = "how fast the exact Fresnel term's excess over Schlick's is lost with the top's alpha"});
    visit(c.trapping, ParameterInfo{.name = "trapping",
                                    .symbol = "h_b",
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
  }

  static Constants<double> initial() {
    Constants<double> constants{};
    describe(constants, [](double& member, const ParameterInfo& info) { member = info.initial; });
    return constants;
  }

  template <LobeMerge merge, class T>
  LOBEFIT_TEXT static void merge_lobes(Slab::Parameters<T>& result, const T& alpha_a, const T& light_a,
                                       const T& alpha_b, const T& light_b, const T& power) {
    const T share = let("share", light_b / max(light_a + light_b, 1e-9));
    const T a = let("a", max(alpha_a, 1e-4)), b = let("b", max(alpha_b, 1e-4));
    if constexpr (merge == LobeMerge::both) {
      result.roughness = sqrt(a);
      result.second_roughness = sqrt(b);
      result.second_roughness_weight = share;
    } else if constexpr (merge == LobeMerge::first) {
      result.roughness = sqrt(a);
      result.second_roughness_weight = T(0.0);
    } else if constexpr (merge == LobeMerge::second) {
      result.roughness = sqrt(b);
      result.second_roughness_weight = T(0.0);
    } else {
      // x^m to the first order in m at m = 0, where the mean is geometric.
      const T m = let("m", select(abs(power) < 1e-3, T(1e-3), power));
      result.roughness = sqrt(min(pow(lerp(T(pow(a, m)), T(pow(b, m)), share), T(1.0 / m)), 1.0));
      result.second_roughness_weight = T(0.0);
    }
  }

  /// What an opaque body's diffuse model keeps of the light: Chan's loses some.
  template <class T, class G>
  LOBEFIT_TEXT static T body_keeps(const Slab::Parameters<T>& slab, const G& cos_theta_o) {
    const T chan = let("chan", call<ChanAlbedo>(cos_theta_o, slab.roughness));
    return select(slab.diffuse_model < 0.5, chan, T(1.0));
  }

  /// The slab that returns this light at the view, its lobes being set already.
  template <class T, class G>
  LOBEFIT_TEXT static void set_light(Slab::Parameters<T>& result, const Vec3<T>& specular, const Vec3<T>& body,
                                     const G& cos_theta_o) {
    const LobeAlbedo<T> albedo = Slab::lobes_albedo(result, cos_theta_o);
    result.f0 = f0_of_albedo(specular, albedo);
    Vec3<T> left = 1.0 - Slab::specular_albedo(result, cos_theta_o);
    const T kept = let("kept", body_keeps(result, cos_theta_o));
    result.diffuse_albedo = at_most(body / (kept * max(left, 0.02)), 1.0);
  }

  template <LobeMerge merge = LobeMerge::mean, class T, class G>
  LOBEFIT_TEXT static Slab::Parameters<T> horizontal(const Slab::Parameters<T>& background,
                                                     const Slab::Parameters<T>& foreground, const T& mix,
                                                     const G& cos_theta_o, const Constants<T>& c) {
    Slab::Parameters<T> result = lerp_slabs(background, foreground, mix);
    Vec3<T> specular_a = Slab::specular_albedo(background, cos_theta_o);
    Vec3<T> specular_b = Slab::specular_albedo(foreground, cos_theta_o);
    Vec3<T> body = lerp(background.diffuse_albedo * ((1.0 - specular_a) * body_keeps(background, cos_theta_o)),
                        foreground.diffuse_albedo * ((1.0 - specular_b) * body_keeps(foreground, cos_theta_o)), mix);
    const T light_a = let("light_a", (1.0 - mix) * mean_of_channels(specular_a));
    const T light_b = let("light_b", mix * mean_of_channels(specular_b));
    const T share = let("share_b", light_b / max(light_a + light_b, 1e-9));
    result.f90 = lerp(background.f90, foreground.f90, share);
    result.specular_tint = lerp(background.specular_tint, foreground.specular_tint, share);
    result.anisotropy = lerp(background.anisotropy, foreground.anisotropy, share);
    merge_lobes<merge>(result, slab_alpha(background), light_a, slab_alpha(foreground), light_b, c.mix_power);
    set_light(result, lerp(specular_a, specular_b, mix), body, cos_theta_o);
    return result;
  }

  template <LobeMerge merge = LobeMerge::mean, class T, class G>
  LOBEFIT_TEXT static Slab::Parameters<T> vertical(const Slab::Parameters<T>& top, const Slab::Parameters<T>& bottom,
                                                   const G& cos_theta_o, const Constants<T>& c) {
    const auto index_of = [](const T& f0) {
      const T root = sqrt(min(f0, 0.9));
      return T((1.0 + root) / (1.0 - root));
    };
    const T f0 = let("f0", mean_of_channels(top.f0));
    const T bottom_f0 = let("bottom_f0", mean_of_channels(bottom.f0));
    const T n = let("n", index_of(f0));
    const T metal = let("metal", saturate((bottom_f0 - 0.08) / 0.12));
    const T bottom_n = let("bottom_n", index_of(T(bottom_f0 * (1.0 - metal))));
    const T alpha = let("alpha", slab_alpha(top));
    const T bottom_alpha = let("bottom_alpha", slab_alpha(bottom));

    // What the bottom is from inside the top.
    const T own_inside = let("own_inside", diffuse_fresnel_inside(bottom_n));
    const T inside = let("inside", diffuse_fresnel_inside(n) * (1.0 - c.rough_interior * alpha));
    // f0 = 0 is no interface, not one of index 1; a metal's has no index.
    const T ratio = let("ratio", select(bottom_f0 * (1.0 - metal) > 1e-4, bottom_n / n, T(1.0)));
    const T between = let("between", square((ratio - 1.0) / (ratio + 1.0)));
    // Of diffuse light, at the interface between the two, from above and from below. Light that came into a denser top
    // from outside, or out of the bottom, is never totally reflected there.
    const T denser = let("denser", max(ratio, 1.0 / ratio));
    const T thin_side = let("thin_side", diffuse_fresnel_outside(denser));
    const T from_above = let("from_above", select(ratio > 1.0, thin_side, between));
    const T from_below = let("from_below", select(ratio > 1.0, T(diffuse_fresnel_inside(denser)), thin_side));
    const T bottom_keeps = let("bottom_keeps", 1.0 - call<GgxAverageLoss>(bottom_alpha));
    Vec3<T> facets = let("facets", bottom.f0 * metal + between * (1.0 - metal));
    Vec3<T> reflectance = let("reflectance", facets * (bottom_keeps + facets * (1.0 - bottom_keeps)));
    Vec3<T> bare = let("bare", bottom.diffuse_albedo / ((1.0 - own_inside) + own_inside * bottom.diffuse_albedo));
    Vec3<T> body = let("body", bare * ((1.0 - from_above) * (1.0 - from_below)) / (1.0 - bare * from_below) +
                                   max(from_above - between, 0.0) * (1.0 - metal));

    // The medium.
    Vec3<T> depth = let("depth", slab_depth(top));
    Vec3<T> scattering = let("scattering", single_scattering_albedo(top.diffuse_albedo, top.phase_anisotropy));
    Vec3<T> absorption = let("absorption", each_channel(top.diffuse_albedo, [&](const T& albedo) {
                               return T(call<SingleScatteringAbsorption>(albedo, top.phase_anisotropy));
                             }));
    const T sine2 = let("sine2", T(1.0 - square(cos_theta_o)) / square(n));
    const T view_path = let("view_path", min(1.0 / sqrt(max(1.0 - sine2, 1e-3)), 8.0));
    // Slabs have Schlick's Fresnel term, interfaces the real one.
    // Not a call: the slab's own shader has the function for colours, and a shader has one text per function.
    const T schlick = let("schlick", SchlickFresnel::evaluate(cos_theta_o, f0, T(1.0)));
    const T excess = let("excess", select(f0 > 1e-4, call<DielectricFresnel>(cos_theta_o, n) - schlick, T(0.0)));
    Vec3<T> coat = let("coat", Slab::specular_albedo(top, cos_theta_o) + excess * exp(-c.rough_fresnel * alpha));
    const T crossed =
        let("crossed", lerp(f0, inside, T(1.0 - exp(-(c.trapping * bottom_alpha + c.top_trapping * alpha)))));
    const T lobe_path = let("lobe_path", lerp(view_path, c.lobe_path, T(saturate(bottom_alpha + alpha))));
    const auto through = [&](const T& tau, const T& omega, const T& absorbed, const T& albedo, const T& path) {
      // (1 - ω') τ' and ω' τ'.
      return T(call<TwoStreamsOver>(T(path * (absorbed * tau)),
                                    T(c.scattering * (omega * (1.0 - top.phase_anisotropy) * tau)), albedo));
    };
    Vec3<T> direct =
        let("direct", each_channel(depth, [&](const T& tau) { return T(exp(-tau * (view_path + lobe_path))); }));
    const auto lobe_through = [&](const T& f, const T& passed) {
      return T((1.0 - crossed) * f * passed / (1.0 - min(crossed * f * passed, 0.9999)));
    };
    const auto body_through = [&](const T& tau, const T& omega, const T& absorbed, const T& albedo, const T& f,
                                  const T& passed) {
      const T path = let("path", lerp(T(0.5 * (view_path + c.light_path)), c.milky_path, omega));
      const T both = let("both", min(albedo + f, 0.9999));
      // Without scattering this is the body alone: the lobe went the same way.
      const T lobe = let("lobe", f * lerp(T(exp(-2.0 * path * tau)), passed, omega));
      const T out = let("out", max(through(tau, omega, absorbed, both, path) - lobe, 0.0));
      const T back = let("back", through(tau, omega, absorbed, both, c.inside_path));
      return T((1.0 - inside) * out / (1.0 - min(inside * back, 0.9999)));
    };
    Vec3<T> specular = each_channel(reflectance, direct, lobe_through);
    Vec3<T> diffuse{body_through(depth.x, scattering.x, absorption.x, body.x, reflectance.x, direct.x),
                    body_through(depth.y, scattering.y, absorption.y, body.y, reflectance.y, direct.y),
                    body_through(depth.z, scattering.z, absorption.z, body.z, reflectance.z, direct.z)};
    specular = specular * (1.0 - coat);

    const T light_top = let("light_top", mean_of_channels(coat));
    const T light = let("light", mean_of_channels(specular));
    const T share = let("share", light / max(light + light_top, 1e-6));
    Slab::Parameters<T> result = lerp_slabs(top, bottom, share);
    result.diffuse_model = bottom.diffuse_model;  // before set_light(), which asks for it
    const T wide = let("wide", c.stretch * log(n));
    const T blurred = let("blurred", sqrt(square(bottom_alpha * exp(wide)) + square(c.blur * (n - 1.0) * alpha)));
    merge_lobes<merge>(result, alpha, light_top, T(min(blurred, 1.0)), light, c.layer_power);
    set_light(result, coat + specular, diffuse * (1.0 - coat), cos_theta_o);

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
    return result;
  }

  /// The cosine of the view where no view is known: the mean over diffuse light.
  static constexpr double mean_view = 2.0 / 3.0;
};

}  // namespace lobefit
