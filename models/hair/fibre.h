// What hair models share: the angles of a fibre, and small functions of them.
//
// z is the fibre's axis and directions are anywhere on the sphere. Inclinations theta are measured from the normal
// plane, sin θ = component along the axis; φ is the azimuth difference, 0 on the retro side; θ_d = (θ_v - θ_l)/2. The
// value is S in 1/sr, as Unreal uses it (S3) and as the `hair` reference gives it: the radiance that leaves is ∫ S L
// dω, without cosine, and the albedo ∫ S dω. Marschner's S, per unit width, is that over cos θ_l.
#pragma once

#include <string_view>

#include "models/geometry.h"
#include "models/microfacet/fresnel.h"
#include "models/parameter.h"

namespace lobefit {

/// Inclinations of light and view. Geometry's own angles are those with the axis.
template <class G>
struct Inclinations {
  G sin_theta_l, sin_theta_v;
  G cos_theta_l, cos_theta_v;
  G cos_theta_d;  // kept off 0, where light and view are at opposite ends of the axis
};

template <class G>
LOBEFIT_TEXT Inclinations<G> make_inclinations(const Geometry<G>& g) {
  const G sin_theta_l = let("sin_theta_l", g.wi.z);
  const G sin_theta_v = let("sin_theta_v", g.wo.z);
  const G cos_theta_l = let("cos_theta_l", sqrt(g.wi.x * g.wi.x + g.wi.y * g.wi.y));
  const G cos_theta_v = let("cos_theta_v", sqrt(g.wo.x * g.wo.x + g.wo.y * g.wo.y));
  // cos((a - b)/2) = |(cos a + cos b, sin a + sin b)|/2
  const G sines = sin_theta_l + sin_theta_v;
  const G cosines = cos_theta_l + cos_theta_v;
  return {.sin_theta_l = sin_theta_l,
          .sin_theta_v = sin_theta_v,
          .cos_theta_l = cos_theta_l,
          .cos_theta_v = cos_theta_v,
          .cos_theta_d = let("cos_theta_d", max(0.5 * sqrt(cosines * cosines + sines * sines), 1e-6))};
}

/// The azimuth difference, without cancellation next to 0 and 180°.
template <class G>
struct Azimuth {
  G cos_phi;
  G cos_half_phi, sin_half_phi;
};

/// With q² = cos²θ_l cos²θ_v, cos φ = t/q, t the tangential dot product. q - |t| cancels, but q² - t² =
/// (wi × wo)_z². `softened` adds S3's 1e-4 to q². Next to an end of the axis, where there is no azimuth, cos φ is 0.
template <bool softened, class G>
LOBEFIT_TEXT Azimuth<G> make_azimuth(const Geometry<G>& g) {
  const G t = g.tangential_dot;
  G across2 = let("across2", square(g.wi.x * g.wo.y - g.wi.y * g.wo.x));
  G q2 = (g.wi.x * g.wi.x + g.wi.y * g.wi.y) * (g.wo.x * g.wo.x + g.wo.y * g.wo.y);
  if constexpr (softened) {
    across2 = across2 + 1e-4;
    q2 = q2 + 1e-4;
  } else {
    q2 = max(q2, smallest_base);
  }
  const G q = let("q", sqrt(q2));
  const G wide = let("wide", q + abs(t));
  const G narrow = let("narrow", across2 / wide);  // q - |t|
  return {.cos_phi = let("cos_phi", t / q),
          .cos_half_phi = let("cos_half_phi", sqrt(0.5 * select(t < 0.0, narrow, wide) / q)),
          .sin_half_phi = let("sin_half_phi", sqrt(0.5 * select(t < 0.0, wide, narrow) / q))};
}

/// arcsin y for 0 ≤ y ≤ √½, to 2e-09: y times a polynomial in y² that interpolates at Chebyshev's points. Narrow lobes
/// make much of what angles lack; this has full relative precision in float, which π/2 - arccos has not.
struct SmallArcSine {
  static constexpr const char* name = "small_asin";
  static constexpr std::array arguments{"y"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& y) {
    const T z = let("z", y * y);
    return y *
           (1.000000002 +
            z * (0.1666661424 +
                 z * (0.07502757316 +
                      z * (0.04409161674 +
                           z * (0.03581423927 +
                                z * (-0.00702057912 + z * (0.1074000213 + z * (-0.1359162712 + z * 0.1239134949))))))));
  }
};

/// φ in [0, π], by the smaller of its half angle's functions.
template <class G>
LOBEFIT_TEXT G azimuth_angle(const Azimuth<G>& azimuth) {
  const G angle = let("angle", 2.0 * call<SmallArcSine>(min(azimuth.cos_half_phi, azimuth.sin_half_phi)));
  return let("phi", select(azimuth.cos_half_phi < azimuth.sin_half_phi, pi - angle, angle));
}

/// sin x for |x| ≤ 0.8, to 3e-14: tilts of cuticle scales. (A shader's own is only good to 1e-3 or so.)
struct SmallSine {
  static constexpr const char* name = "small_sine";
  static constexpr std::array arguments{"x"};

  template <class T>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& x) {
    const T x2 = let("x2", x * x);
    return x * (1.0 - x2 / 6.0 *
                          (1.0 - x2 / 20.0 *
                                     (1.0 - x2 / 42.0 * (1.0 - x2 / 72.0 * (1.0 - x2 / 110.0 * (1.0 - x2 / 156.0))))));
  }
};

/// Normal density: S3's Hair_g.
struct HairGaussian {
  static constexpr const char* name = "hair_g";
  static constexpr std::array arguments{"width", "x"};

  template <class W, class X>
  LOBEFIT_TEXT static auto evaluate(const W& width, const X& x) {
    const auto deviations = let("deviations", x / width);
    return exp(-0.5 * (deviations * deviations)) / (width * 2.506628274631000502);  // √(2π)
  }
};

/// ((1 - η)/(1 + η))²
template <class T>
LOBEFIT_TEXT auto normal_reflectance(const T& ior) {
  const auto amplitude = (1.0 - ior) / (1.0 + ior);
  return amplitude * amplitude;
}

/// Schlick's reflectance of a fibre: S3's Hair_F.
struct HairSchlick {
  static constexpr const char* name = "hair_f";
  static constexpr std::array arguments{"cosine", "f0"};

  template <class X, class F>
  LOBEFIT_TEXT static auto evaluate(const X& cosine, const F& f0) {
    return f0 + (1.0 - f0) * call<Pow5>(1.0 - cosine);
  }
};

/// colour^power per channel.
struct HairColorPower {
  static constexpr const char* name = "hair_color_power";
  static constexpr std::array arguments{"color", "power"};

  template <class V, class P>
  LOBEFIT_TEXT static auto evaluate(const V& color, const P& power) {
    return V{pow(color.x, power), pow(color.y, power), pow(color.z, power)};
  }
};

/// 1/η' of Bravais's index η' = √(η² - sin²θ_d)/cos θ_d, with which a skew ray's projection on the cross-section obeys
/// Snell's law.
template <class T, class G>
LOBEFIT_TEXT auto inverse_bravais_index(const T& ior, const G& cos_theta_d) {
  return cos_theta_d / sqrt((ior - 1.0) * (ior + 1.0) + cos_theta_d * cos_theta_d);
}

// Parameters that hair models share, by the names of the `hair` reference.

inline constexpr ParameterInfo hair_base_color_parameter{
    .name = "base_color", .symbol = "C", .initial = 1.0, .doc = "What a TRT path along the diameter leaves of white."};
inline constexpr ParameterInfo hair_roughness_parameter{
    .name = "roughness",
    .symbol = "r",
    .lower = 1.0 / 255.0,
    .initial = 0.3,
    .doc = "Perceptual roughness: the widths of the lobes are multiples of its square.",
    .perceptual_roughness = true};
inline constexpr ParameterInfo hair_ior_parameter{.name = "ior",
                                                  .symbol = "η",
                                                  .lower = 1.05,
                                                  .upper = 3.0,
                                                  .initial = 1.55,
                                                  .tier = Tier::advanced,
                                                  .doc = "Refractive index of the fibre."};
inline constexpr ParameterInfo hair_shift_parameter{.name = "shift",
                                                    .symbol = "α",
                                                    .unit = "rad",
                                                    .lower = -0.1,
                                                    .upper = 0.1,
                                                    .initial = 0.035,
                                                    .tier = Tier::advanced,
                                                    .doc = "Tilt of the cuticle scales."};

/// Widths of R, TT, TRT over roughness², and their tilts over shift.
template <class P, class Visit>
constexpr void describe_hair_lobes(P& p, Visit&& visit) {
  const auto width = [&](auto& member, std::string_view name, std::string_view symbol, double initial,
                         std::string_view doc) {
    visit(member, ParameterInfo{.name = name,
                                .symbol = symbol,
                                .lower = 0.1,
                                .upper = 3.0,
                                .initial = initial,
                                .tier = Tier::advanced,
                                .doc = doc});
  };
  width(p.width_r, "width_r", "β_R/r²", 1.0, "Width of R over roughness².");
  width(p.width_tt, "width_tt", "β_TT/r²", 0.5, "Width of TT over roughness².");
  width(p.width_trt, "width_trt", "β_TRT/r²", 2.0, "Width of TRT over roughness².");
  const auto tilt = [&](auto& member, std::string_view name, std::string_view symbol, double initial,
                        std::string_view doc) {
    visit(member, ParameterInfo{.name = name,
                                .symbol = symbol,
                                .lower = -8.0,
                                .upper = 8.0,
                                .initial = initial,
                                .tier = Tier::advanced,
                                .doc = doc});
  };
  tilt(p.tilt_r, "tilt_r", "α_R/α", -2.0, "Tilt of R over shift.");
  tilt(p.tilt_tt, "tilt_tt", "α_TT/α", 1.0, "Tilt of TT over shift.");
  tilt(p.tilt_trt, "tilt_trt", "α_TRT/α", 4.0, "Tilt of TRT over shift.");
}

}  // namespace lobefit
