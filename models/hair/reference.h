// S3's own reference for its hair, HairShadingRef: d'Eon's integrals with few samples over the fibre's width.
#pragma once

#include <utility>

#include "models/hair/longitudinal.h"
#include "models/hair/reference_lobes.h"
#include "models/model.h"

namespace lobefit {

/// The Gaussian summed over five turns, for phi in [-2π, 2π]. S3 sums nine, for it does not wrap what it feeds; those
/// that are missing here are 1e-4 of the mean at a width of 3, 3e-9 at 2.
struct HairGaussianDetector {
  static constexpr const char* name = "gaussian_detector";
  static constexpr std::array arguments{"width", "phi"};

  template <class W, class X>
  LOBEFIT_TEXT static auto evaluate(const W& width, const X& phi) {
    return (density(width, phi) + density(width, phi - 2.0 * pi) + density(width, phi + 2.0 * pi) +
            density(width, phi - 4.0 * pi) + density(width, phi + 4.0 * pi)) /
           (width * 2.506628274631000502);  // √(2π)
  }

 private:
  template <class W, class X>
  LOBEFIT_TEXT static auto density(const W& width, const X& phi) {
    return exp(-0.5 * square(phi / width));
  }
};

/// The detectors of two rays that leave at ±bend.
struct HairDetectorPair {
  static constexpr const char* name = "detector_pair";
  static constexpr std::array arguments{"width", "phi", "bend"};

  template <class W, class X, class B>
  LOBEFIT_TEXT static auto evaluate(const W& width, const X& phi, const B& bend) {
    return call<HairGaussianDetector>(width, phi - bend) + call<HairGaussianDetector>(width, phi + bend);
  }
};

/// What the rays at offsets ±h give: Fresnel's and the detectors' factors of TT and TRT, and the length cosγ_t.
/// `gamma_i` = asin h.
struct HairRayPair {
  static constexpr const char* name = "hair_ray_pair";
  static constexpr std::array arguments{"h",  "gamma_i",  "phi",       "inverse_index", "cos_theta_d", "cos_theta_t",
                                        "f0", "width_tt", "width_trt", "m_tt",          "m_trt",       "color"};

  template <class X, class G, class T, class M, class V>
  LOBEFIT_TEXT static auto evaluate(const X& h, const X& gamma_i, const G& phi, const T& inverse_index,
                                    const G& cos_theta_d, const T& cos_theta_t, const T& f0, const T& width_tt,
                                    const T& width_trt, const M& m_tt, const M& m_trt, const V& color) {
    const T sin_gamma_t = let("sin_gamma_t", h * inverse_index);
    const T cos_gamma_t = let("cos_gamma_t", sqrt(1.0 - sin_gamma_t * sin_gamma_t));
    // sin(γ/2) = sin γ/√(2 + 2 cos γ)
    const T gamma_t = let("gamma_t", 2.0 * call<SmallArcSine>(T(sin_gamma_t / sqrt(2.0 + 2.0 * cos_gamma_t))));
    const T power = let("power", 0.5 * cos_gamma_t / cos_theta_t);
    const T f = let("f", call<HairSchlick>(cos_theta_d * sqrt(1.0 - h * h), f0));
    // Φ(p, h) = 2pγ_t - 2γ_i + pπ, odd in h but for pπ; 2π is a turn.
    const T bend_tt = let("bend_tt", 2.0 * gamma_t - 2.0 * gamma_i);
    const T bend_trt = let("bend_trt", 4.0 * gamma_t - 2.0 * gamma_i);
    const T d_tt = let("d_tt", call<HairDetectorPair>(width_tt, phi - pi, bend_tt));
    const T d_trt = let("d_trt", call<HairDetectorPair>(width_trt, phi, bend_trt));
    V once = let("once", call<HairColorPower>(color, power));
    const T through = let("through", square(1.0 - f));
    return once * (through * m_tt * d_tt) + once * once * (through * f * m_trt * d_trt);
  }
};

/// S3's HairShadingRef: M_p of d'Eon with tilts and N_p by sixteen midpoints over h (S3 moves them by a random offset
/// per pixel), which enter in pairs ±h. Kept from the code: R's mirror at a tilted normal and its width
/// √2 cos(φ/2) β_R; Fresnel at the half vector for R; θ_t of the light alone; μ = -¼ ln C along the ray's length.
///
/// Sixteen samples resolve lobes as wide as their spacing: at small roughness the azimuth shows their spikes, and the
/// `hair` reference, which is their limit, is the ground truth. cos(φ/2) in R's width is kept above .005, where the
/// softened azimuth of hair_unreal keeps it: at φ = 180° M has no bound.
struct HairReference {
  static constexpr ModelInfo info{
      .name = "hair_reference",
      .title = "Unreal Engine's hair by its own quadrature, 16 samples",
      .source = "Unreal Engine 4, HairBsdf.ush, HairShadingRef (S3); d'Eon et al. 2011",
      .kind = ModelKind::hair,
      .reciprocal = false,
      .energy_conserving = false,
      .doc =
          "R, TT and TRT with d'Eon's M and 16 midpoints over the fibre's width. The exact integral is the reference "
          "`hair`. z is the fibre's axis; the value is S: radiance = ∫ S L dω, without cosine."};

  template <class T>
  struct Parameters {
    Vec3<T> base_color;
    T roughness, ior, shift;
    T width_r, width_tt, width_trt;
    T tilt_r, tilt_tt, tilt_trt;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.base_color, hair_base_color_parameter);
    visit(p.roughness, hair_roughness_parameter);
    visit(p.ior, hair_ior_parameter);
    visit(p.shift, hair_shift_parameter);
    describe_hair_lobes(p, visit);
  }

  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    // Not const: see make_geometry().
    Inclinations<G> inclinations = make_inclinations(g);
    Azimuth<G> azimuth = make_azimuth<false>(g);
    const G phi = azimuth_angle(azimuth);
    const G sin_theta_l = inclinations.sin_theta_l;
    const G cos_theta_l = inclinations.cos_theta_l;
    const T width = let("width", p.roughness * p.roughness);
    const T width_r = let("width_r", p.width_r * width);
    const T width_tt = let("width_tt", p.width_tt * width);
    const T width_trt = let("width_trt", p.width_trt * width);
    const T f0 = let("f0", normal_reflectance(p.ior));

    const G half_scale = let("half_scale", max(azimuth.cos_half_phi, 5e-3));
    const T sin_r = let("sin_r", call<SmallSine>(p.tilt_r * p.shift));
    const T cos_r = let("cos_r", sqrt(1.0 - sin_r * sin_r));
    const T mirrored = let(
        "mirrored",
        inclinations.sin_theta_v -
            2.0 * sin_r * (azimuth.cos_half_phi * cos_r * inclinations.cos_theta_v + sin_r * inclinations.sin_theta_v));
    const T m_r = let("m_r", call<HairBesselM>(T(width_r * (std::numbers::sqrt2 * half_scale)), sin_theta_l,
                                               cos_theta_l, mirrored, T(sqrt((1.0 - mirrored) * (1.0 + mirrored)))));
    Vec3<G> sum = g.wi + g.wo;
    const G half_vector_cosine = let("half_vector_cosine", 0.5 * sqrt(dot(sum, sum)));
    const T f_r = let("f_r", call<HairSchlick>(half_vector_cosine, f0));

    const T m_tt = let("m_tt", lowered(width_tt, T(p.tilt_tt * p.shift), inclinations));
    const T m_trt = let("m_trt", lowered(width_trt, T(p.tilt_trt * p.shift), inclinations));
    const T inverse_index = let("inverse_index", inverse_bravais_index(p.ior, inclinations.cos_theta_d));
    const T cos_theta_t = let("cos_theta_t", sqrt((p.ior - sin_theta_l) * (p.ior + sin_theta_l)) / p.ior);

    const T n_r = let("n_r", reflected(width_r, phi, std::make_integer_sequence<int, pairs>{}));
    Vec3<T> inside = transmitted(p, phi, inclinations.cos_theta_d, inverse_index, cos_theta_t, f0, width_tt, width_trt,
                                 m_tt, m_trt, std::make_integer_sequence<int, pairs>{});
    return inside * (0.5 / pairs) + m_r * n_r * f_r * (0.5 / pairs);
  }

  /// Over the whole sphere, lobe by lobe and ray by ray.
  static Direction sample(const Parameters<double>& p, const Direction& wo, const std::array<double, 2>& u) {
    return HairReferenceLobes<pairs, Parameters<double>>(p, wo).sample(u);
  }
  static double pdf(const Parameters<double>& p, const Direction& wi, const Direction& wo) {
    return HairReferenceLobes<pairs, Parameters<double>>(p, wo).pdf(wi);
  }

 private:
  static constexpr int pairs = 8;
  static constexpr std::array names{"rays_1", "rays_2", "rays_3", "rays_4", "rays_5", "rays_6", "rays_7", "rays_8"};
  static constexpr double offset(int k) { return (k + 0.5) / pairs; }

  /// M of light and a view whose inclination is lowered by `angle`; past the end of the axis its cosine's size.
  template <class T, class G>
  LOBEFIT_TEXT static T lowered(const T& width, const T& angle, const Inclinations<G>& i) {
    const T s = let("s", call<SmallSine>(angle));
    const T c = let("c", sqrt(1.0 - s * s));
    const T sine = let("lowered", i.sin_theta_v * c - i.cos_theta_v * s);
    return call<HairBesselM>(width, i.sin_theta_l, i.cos_theta_l, sine, T(abs(i.cos_theta_v * c + i.sin_theta_v * s)));
  }
  /// Φ(0, h) = -2 asin h.
  template <class T, class G, int... k>
  LOBEFIT_TEXT static T reflected(const T& width, const G& phi, std::integer_sequence<int, k...>) {
    return (... + call<HairDetectorPair>(width, phi, G(2.0 * std::asin(offset(k)))));
  }
  template <class T, class G, int... k>
  LOBEFIT_TEXT static Vec3<T> transmitted(const Parameters<T>& p, const G& phi, const G& cos_theta_d,
                                          const T& inverse_index, const T& cos_theta_t, const T& f0, const T& width_tt,
                                          const T& width_trt, const T& m_tt, const T& m_trt,
                                          std::integer_sequence<int, k...>) {
    return (... +
            let(names[k], call<HairRayPair>(G(offset(k)), G(std::asin(offset(k))), phi, inverse_index, cos_theta_d,
                                            cos_theta_t, f0, width_tt, width_trt, m_tt, m_trt, p.base_color)));
  }
};

}  // namespace lobefit
