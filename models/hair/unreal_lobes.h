// Sampling of hair_unreal: a density for each of its lobes.
#pragma once

#include "models/hair/absorption.h"
#include "models/hair/longitudinal.h"
#include "models/hair/sampling.h"

namespace lobefit {

/// Lobes of one view. Along the axis each is S3's Gaussian in sin θ, cut to [-1, 1]; around it R goes as cos(φ/2), TT
/// and TRT as exp(κ cos φ). The diffuse term is left to the uniform sphere. `P`: HairUnreal::Parameters<double>.
template <class P>
class HairUnrealLobes {
 public:
  HairUnrealLobes(const P& p, const Direction& wo) : p_(p), view_(wo), width_(p.roughness * p.roughness) {
    const double f0 = normal_reflectance(p.ior);
    const double r = (1.0 + p.backlit) * p.specular * mean_hair_reflectance(cos_theta_d(along_r(0.0)), f0) *
                     share_within_unit(centre_of_r(0.0), p.width_r * width_);

    const double cosine_tt = cos_theta_d(along_tt());
    const double enters_tt = 1.0 - HairSchlick::evaluate(cosine_tt, f0);
    const double tt = p.backlit * enters_tt * enters_tt * circle(kappa_tt(), p.tt_azimuth_constant) *
                      mean(transmittance_tt(cosine_tt)) * share_within_unit(centre(p.tilt_tt), p.width_tt * width_);

    const double cosine_trt = cos_theta_d(along_trt());
    const double f_trt = HairSchlick::evaluate(cosine_trt * p.trt_cosine, f0);
    const double trt = (1.0 - f_trt) * (1.0 - f_trt) * f_trt * circle(kappa_trt(), p.trt_azimuth_constant) *
                       mean(HairColorPower::evaluate(p.base_color, p.trt_absorption / cosine_trt)) *
                       share_within_unit(centre(p.tilt_trt), p.width_trt * width_);

    // ∫ dω of the diffuse term's constant part is 4; it rarely exceeds half of that.
    const double scattered = 2.0 * p.scatter * mean(HairColorPower::evaluate(p.base_color, 0.5));
    shares_ = hair_lobe_shares(r, tt, trt, scattered);
  }

  Direction sample(std::array<double, 2> u) const {
    switch (pick_lobe(shares_, u)) {
      case 0: {
        const double phi = sample_r_azimuth(u[1]);
        return at(along_r(phi).sample(u[0]), phi);
      }
      case 1: return at(along_tt().sample(u[0]), WrappedCauchy(kappa_tt()).sample(u[1]) + pi);
      case 2: return at(along_trt().sample(u[0]), WrappedCauchy(kappa_trt()).sample(u[1]));
      default: return sample_sphere(u);
    }
  }
  double pdf(const Direction& wi) const {
    const double phi = view_.phi(wi), sine = wi.z;
    // dω = d(sin θ) dφ
    return shares_[0] * r_azimuth_density(phi) * along_r(phi).density(sine) +
           shares_[1] * WrappedCauchy(kappa_tt()).density(pi - abs(phi)) * along_tt().density(sine) +
           shares_[2] * WrappedCauchy(kappa_trt()).density(phi) * along_trt().density(sine) +
           shares_[3] * sphere_density;
  }

 private:
  /// Sampled lobes are this much wider than S3's, so that no tail outruns its density.
  static constexpr double widening = 1.1;

  static double mean(const Rgb& c) { return (c.x + c.y + c.z) / 3.0; }
  /// ∫ exp(κ cos φ - c) dφ
  static double circle(double kappa, double c) {
    return 2.0 * pi * ScaledBesselI0::evaluate(kappa) * std::exp(kappa - c);
  }
  Direction at(double sine, double phi) const { return view_.at(sine, sqrt((1.0 - sine) * (1.0 + sine)), phi); }

  double centre(double tilt) const { return tilt * p_.shift - view_.sin_theta; }
  static double clamped(double sine) { return min(max(sine, -1.0), 1.0); }
  static TruncatedGaussian along(double mean, double width) { return {clamped(mean), widening * width, -1.0, 1.0}; }
  TruncatedGaussian along_tt() const { return along(centre(p_.tilt_tt), p_.width_tt * width_); }
  TruncatedGaussian along_trt() const { return along(centre(p_.tilt_trt), p_.width_trt * width_); }

  double kappa_tt() const { return p_.tt_azimuth_cosine * softening(typical_sine(along_tt())); }
  double kappa_trt() const { return p_.trt_azimuth_cosine * softening(typical_sine(along_trt())); }
  /// S3's softened cos φ over cos φ, for light at sin θ: towards the ends of the axis azimuths matter less.
  double softening(double sine) const {
    const double q = sqrt((1.0 - sine) * (1.0 + sine)) * view_.cos_theta;
    return q / std::sqrt(q * q + 1e-4);
  }
  /// The middle of a lobe, or half its width off where that is at an end of the axis.
  static double typical_sine(const TruncatedGaussian& lobe) {
    const double inside = max(1.0 - 0.5 * lobe.width(), 0.5);
    return min(max(lobe.mean(), -inside), inside);
  }
  double cos_theta_d(const TruncatedGaussian& lobe) const {
    return max(view_.cos_theta_d(std::asin(typical_sine(lobe))), 1e-3);
  }

  /// T_TT of a ray through the middle.
  Rgb transmittance_tt(double cos_theta_d) const {
    if (p_.absorption_form < 0.5) {
      return HairTransmittance::evaluate(p_.base_color, p_.tt_absorption / cos_theta_d, 0.0);
    }
    const double d_b = ChiangAbsorptionScale::evaluate(p_.absorption_roughness);
    const double chord = p_.absorption_form < 1.5 ? 1.0 : 1.0 / cos_theta_d;
    return HairTransmittance::evaluate(p_.base_color, 0.0, 2.0 * chord / (d_b * d_b));
  }

  /// cos(φ/2)/4, and in some share 1/2π: softened, cos(φ/2) doesn't reach 0 where φ = 180°.
  double sample_r_azimuth(double u) const {
    const double share = cosine_share();
    std::array<double, 2> v{u, 0.0};
    if (pick_lobe<2>({share, 1.0 - share}, v) == 0) return 2.0 * std::asin(2.0 * v[0] - 1.0);
    return pi * (2.0 * v[0] - 1.0);
  }
  double r_azimuth_density(double phi) const { return lerp(0.5 / pi, 0.25 * std::cos(0.5 * phi), cosine_share()); }
  double cosine_share() const { return 15.0 / 16.0 * softening(typical_sine(along_r(0.0))); }

  /// S3's softened cos(φ/2) for light at sin θ.
  double cos_half_phi(double sine, double phi) const { return sqrt(0.5 * (1.0 + softening(sine) * std::cos(phi))); }
  /// Where R's Gaussian has its mean, in sin θ, for light at an azimuth and at `sine`.
  double mirrored(double sine, double phi) const {
    const double alpha = p_.tilt_r * p_.shift;
    if (p_.r_form > 1.5) return alpha - view_.sin_theta;
    const double s = std::sin(alpha), c = std::cos(alpha);
    return 2.0 * s * (c * cos_half_phi(sine, phi) * view_.cos_theta + s * view_.sin_theta) - view_.sin_theta;
  }
  /// Where R is brightest at an azimuth: at `sine` = mirrored(sine), which a few rounds settle.
  double centre_of_r(double phi) const {
    double sine = -view_.sin_theta, change = 1.0;
    for (int round = 0; round < 40 && abs(change) > 0.01 * p_.width_r * width_; ++round) {
      const double next = mirrored(clamped(sine), phi);
      change = next - sine;
      sine = next;
    }
    return sine;
  }
  TruncatedGaussian along_r(double phi) const {
    const double mean = clamped(centre_of_r(phi)), constant_width = p_.width_r * width_;
    double width = constant_width * (p_.r_form < 0.5 ? std::numbers::sqrt2 * cos_half_phi(mean, phi) : 1.0);
    // Next to an end of the axis the mean follows the light, and R may reach the end however far it is in widths.
    for (const double end : {-1.0, 1.0}) {
      const double reach = abs(end - mirrored(end, phi)) / constant_width;
      if (reach < 5.0) width = max(width, abs(end - mean) / max(reach, 1.0));
    }
    return along(mean, width);
  }

  const P& p_;
  FibreView view_;
  double width_;
  std::array<double, 4> shares_;
};

}  // namespace lobefit
