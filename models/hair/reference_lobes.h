// Sampling of hair_reference: a density for each of its lobes.
#pragma once

#include "models/hair/longitudinal.h"
#include "models/hair/sampling.h"

namespace lobefit {

/// Lobes of one view, `ray_pairs` pairs of rays ±h. Along the fibre each is a Gaussian in θ, which d'Eon's M is where
/// it is narrow; around it, Gaussians about the azimuths at which the rays leave. Those of TT and TRT depend on the
/// light's θ, and R's θ on its azimuth: what depends is drawn last.
template <int ray_pairs, class P>
class HairReferenceLobes {
 public:
  HairReferenceLobes(const P& p, const Direction& wo)
      : p_(p), view_(wo), width_(p.roughness * p.roughness), sin_r_(std::sin(p.tilt_r * p.shift)) {
    // On the axis there is no azimuth to put a ray at.
    if (view_.cos_theta < 1e-15) {
      shares_ = {0.0, 0.0, 0.0, 1.0};
      return;
    }
    const double f0 = normal_reflectance(p.ior);
    const double r = mean_hair_reflectance(cos_theta_d(along_r(1.0)), f0);
    const double into_tt = 1.0 - mean_hair_reflectance(cos_theta_d(along_tt()), f0);
    const double f_trt = mean_hair_reflectance(cos_theta_d(along_trt()), f0);
    shares_ = hair_lobe_shares(r, into_tt * into_tt * transmittance(along_tt(), 1.0),
                               (1.0 - f_trt) * (1.0 - f_trt) * f_trt * transmittance(along_trt(), 2.0), 0.0);
  }

  Direction sample(std::array<double, 2> u) const {
    const std::size_t lobe = pick_lobe(shares_, u);
    if (lobe == 3) return sample_sphere(u);
    const int ray = static_cast<int>(u[1] * (2 * ray_pairs));
    const double v = u[1] * (2 * ray_pairs) - ray;
    if (lobe == 0) {
      const double phi = bend_r(ray) + around(p_.width_r).sample(v);
      return at(along_r(std::cos(0.5 * phi)).sample(u[0]), phi);
    }
    const double theta = (lobe == 1 ? along_tt() : along_trt()).sample(u[0]);
    const double inverse_index = inverse_index_at(theta);
    const double phi = lobe == 1 ? bend_tt(ray, inverse_index) + around(p_.width_tt).sample(v)
                                 : bend_trt(ray, inverse_index) + around(p_.width_trt).sample(v);
    return at(theta, phi);
  }
  double pdf(const Direction& wi) const {
    const double cos_theta = std::hypot(wi.x, wi.y), theta = std::atan2(wi.z, cos_theta), phi = view_.phi(wi);
    const double inverse_index = inverse_index_at(theta);
    const TruncatedGaussian around_r = around(p_.width_r), around_tt = around(p_.width_tt),
                            around_trt = around(p_.width_trt);
    double r = 0.0, tt = 0.0, trt = 0.0;
    for (int ray = 0; ray < 2 * ray_pairs; ++ray) {
      r += around_r.density(std::remainder(phi - bend_r(ray), 2.0 * pi));
      tt += around_tt.density(std::remainder(phi - bend_tt(ray, inverse_index), 2.0 * pi));
      trt += around_trt.density(std::remainder(phi - bend_trt(ray, inverse_index), 2.0 * pi));
    }
    r *= shares_[0] * along_r(std::cos(0.5 * phi)).density(theta);
    tt *= shares_[1] * along_tt().density(theta);
    trt *= shares_[2] * along_trt().density(theta);
    // dω = cos θ dθ dφ
    return (r + tt + trt) / (2 * ray_pairs * max(cos_theta, smallest_base)) + shares_[3] * sphere_density;
  }

 private:
  /// Sampled lobes are this much wider than the model's, so that no tail outruns its density.
  static constexpr double widening = 1.1;

  /// In the middle of a lobe, or half its width off where that is at the end of the axis.
  double cos_theta_d(const TruncatedGaussian& lobe) const {
    return max(view_.cos_theta_d(lobe.mean()), min(0.5 * lobe.width(), 0.5));
  }
  /// Of a ray through the middle of the fibre, `lengths` times across.
  double transmittance(const TruncatedGaussian& lobe, double lengths) const {
    const double sine = std::sin(lobe.mean());
    const double power = 0.5 * lengths * p_.ior / sqrt((p_.ior - sine) * (p_.ior + sine));
    const Rgb color = HairColorPower::evaluate(p_.base_color, power);
    return (color.x + color.y + color.z) / 3.0;
  }
  Direction at(double theta, double phi) const { return view_.at(std::sin(theta), std::cos(theta), phi); }

  /// Along the fibre: around the mirror of a cone of sine `sine`.
  static TruncatedGaussian along(double sine, double width) {
    return {-std::asin(min(max(sine, -1.0), 1.0)), widening * width, -0.5 * pi, 0.5 * pi};
  }
  TruncatedGaussian along_r(double cos_half_phi) const {
    const double cos_r = sqrt(1.0 - sin_r_ * sin_r_), c = abs(cos_half_phi);
    const double mirrored = view_.sin_theta - 2.0 * sin_r_ * (c * cos_r * view_.cos_theta + sin_r_ * view_.sin_theta);
    return along(mirrored, p_.width_r * width_ * std::numbers::sqrt2 * max(c, 5e-3));
  }
  TruncatedGaussian along_tt() const { return along(lowered(p_.tilt_tt), p_.width_tt * width_); }
  TruncatedGaussian along_trt() const { return along(lowered(p_.tilt_trt), p_.width_trt * width_); }
  double lowered(double tilt) const {
    const double angle = tilt * p_.shift;
    return view_.sin_theta * std::cos(angle) - view_.cos_theta * std::sin(angle);
  }

  /// Around a ray's own azimuth. The model's Gaussians go on beyond 180°; half of the circle each way is enough here.
  TruncatedGaussian around(double width) const { return {0.0, widening * width * width_, -pi, pi}; }

  double inverse_index_at(double theta) const {
    return inverse_bravais_index(p_.ior, max(view_.cos_theta_d(theta), 1e-6));
  }
  static double offset(int ray) { return (ray + 0.5) / ray_pairs - 1.0; }
  static double bend_r(int ray) { return 2.0 * std::asin(offset(ray)); }
  static double bend_tt(int ray, double inverse_index) {
    return pi + 2.0 * std::asin(offset(ray) * inverse_index) - 2.0 * std::asin(offset(ray));
  }
  static double bend_trt(int ray, double inverse_index) {
    return 4.0 * std::asin(offset(ray) * inverse_index) - 2.0 * std::asin(offset(ray));
  }

  const P& p_;
  FibreView view_;
  double width_, sin_r_;
  std::array<double, 4> shares_;
};

}  // namespace lobefit
