// What sampling around a fibre is made of, in double: Gaussians cut to an interval, lobes around the axis, and the
// coordinates in which hair's lobes are products, inclination × azimuth.
#pragma once

#include <numbers>

#include "models/hair/fibre.h"
#include "models/microfacet/sampling.h"
#include "models/sampling.h"

namespace lobefit {

/// Normal density with its mean within [low, high], cut to that interval and normalised there.
class TruncatedGaussian {
 public:
  TruncatedGaussian(double mean, double width, double low, double high)
      : mean_(mean),
        width_(width),
        low_(low),
        high_(high),
        erf_low_(std::erf((low - mean) / (std::numbers::sqrt2 * width))),
        erf_high_(std::erf((high - mean) / (std::numbers::sqrt2 * width))) {}

  double mean() const { return mean_; }
  double width() const { return width_; }

  double sample(double u) const {
    return min(max(mean_ + std::numbers::sqrt2 * width_ * inverse_erf(lerp(erf_low_, erf_high_, u)), low_), high_);
  }
  double density(double x) const { return HairGaussian::evaluate(width_, x - mean_) * 2.0 / (erf_high_ - erf_low_); }

 private:
  double mean_, width_, low_, high_, erf_low_, erf_high_;
};

/// Share of a normal density that lies within [-1, 1].
inline double share_within_unit(double mean, double width) {
  const double scale = std::numbers::sqrt2 * width;
  return 0.5 * (std::erf((1.0 - mean) / scale) + std::erf((1.0 + mean) / scale));
}

/// Azimuths around 0 for a lobe exp(κ cos φ): the wrapped Cauchy density that envelops it, at most 1.52 times too low
/// (Best, Fisher 1979, Efficient Simulation of the von Mises Distribution).
struct WrappedCauchy {
  explicit WrappedCauchy(double kappa) {
    // ρ = (τ - √(2τ))/(2κ), τ = 1 + √(1 + 4κ²): 0/0 at κ = 0, where ρ goes to κ/2.
    const double root = std::sqrt(1.0 + 4.0 * kappa * kappa), tau = 1.0 + root;
    rho = 2.0 * kappa / ((1.0 + root) * (1.0 + std::sqrt(2.0 / tau)));
  }
  double sample(double u) const { return 2.0 * std::atan((1.0 - rho) / (1.0 + rho) * std::tan(pi * (u - 0.5))); }
  double density(double phi) const {
    // 1 + ρ² - 2ρ cos φ without cancellation.
    const double half = std::sin(0.5 * phi);
    return (1.0 - rho) * (1.0 + rho) / (2.0 * pi * ((1.0 - rho) * (1.0 - rho) + 4.0 * rho * half * half));
  }

  double rho;
};

/// The view's place, and a direction's from there: sin θ along the axis, and φ from the view's azimuth.
struct FibreView {
  explicit FibreView(const Direction& wo)
      : sin_theta(wo.z), cos_theta(std::hypot(wo.x, wo.y)), azimuth(std::atan2(wo.y, wo.x)) {}

  Direction at(double sin_theta_l, double cos_theta_l, double phi) const {
    return {cos_theta_l * std::cos(azimuth + phi), cos_theta_l * std::sin(azimuth + phi), sin_theta_l};
  }
  double phi(const Direction& wi) const { return std::remainder(std::atan2(wi.y, wi.x) - azimuth, 2.0 * pi); }
  double cos_theta_d(double theta_l) const { return std::cos(0.5 * (std::atan2(sin_theta, cos_theta) - theta_l)); }

  double sin_theta, cos_theta, azimuth;
};

/// Mean of Fresnel's reflectance over the rays that hit the fibre.
inline double mean_hair_reflectance(double cos_theta_d, double f0) {
  constexpr int rays = 4;
  double sum = 0.0;
  for (int k = 0; k < rays; ++k) {
    const double h = (k + 0.5) / rays;
    sum += HairSchlick::evaluate(cos_theta_d * std::sqrt(1.0 - h * h), f0);
  }
  return sum / rays;
}

/// Shares of R, TT, TRT and the uniform sphere from their energies; the sphere, which also guards against lobes that
/// are elsewhere than their densities, gets a sixteenth more.
inline std::array<double, 4> hair_lobe_shares(double r, double tt, double trt, double sphere) {
  const double all = sphere + (r + tt + trt + sphere) / 15.0 + 1e-12;
  const double sum = r + tt + trt + all;
  return {r / sum, tt / sum, trt / sum, all / sum};
}

}  // namespace lobefit
