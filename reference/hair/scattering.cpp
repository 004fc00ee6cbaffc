#include "reference/hair/scattering.h"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <boost/math/special_functions/bessel.hpp>
#include <cmath>
#include <limits>

namespace lobefit {

namespace {

constexpr double smallest_variance = 1e-24;
constexpr int allowed_stalls = 3;
constexpr double widest_summed = 2.0;  // deviation of a detector that is summed turn by turn

/// √(1 - x²) without cancellation.
double cosine_of(double sine) { return sqrt((1.0 - sine) * (1.0 + sine)); }

/// The rays of one lobe over gamma = γi.
struct Rays {
  int lobe;
  double inverse_index;  // 1/η'

  double exit(double gamma) const {
    const double inner = std::asin(std::min(1.0, std::max(-1.0, std::sin(gamma) * inverse_index)));
    return 2.0 * lobe * inner - 2.0 * gamma + lobe * pi;
  }
  /// Intervals of γi on which Φ is monotone.
  std::vector<double> monotone_knots() const {
    std::vector<double> knots{-0.5 * pi, 0.5 * pi};
    if (inverse_index <= 0.0) return knots;
    if (const std::optional<double> h = caustic_offset(lobe, 1.0 / inverse_index); h && *h < 1.0) {
      knots.insert(knots.begin() + 1, {-std::asin(*h), std::asin(*h)});
    }
    return knots;
  }
  /// Where Φ = target on a monotone interval that spans it, to `tolerance` in Φ: secants kept inside by bisection.
  double solve(double low, double high, double target, double tolerance) const {
    double at_low = exit(low) - target, at_high = exit(high) - target;
    const bool rising = at_low < at_high;
    for (int step = 0; step < 200; ++step) {
      // Every third step halves, for the secant crawls near a caustic.
      double middle = step % 3 == 2 ? 0.5 * (low + high) : low - at_low * (high - low) / (at_high - at_low);
      if (!(middle > low && middle < high)) middle = 0.5 * (low + high);
      if (middle <= low || middle >= high) return middle;
      const double value = exit(middle) - target;
      if (std::abs(value) <= tolerance) return middle;
      if ((value < 0.0) == rising) {
        low = middle, at_low = value;
      } else {
        high = middle, at_high = value;
      }
    }
    return 0.5 * (low + high);
  }
};

double inverse_bravais_index(double ior, double cos_theta_d) {
  return std::min(1.0, cos_theta_d / std::sqrt((ior - 1.0) * (ior + 1.0) + cos_theta_d * cos_theta_d));
}

/// A without absorption, and the power of the colour that absorption is.
struct PathWeight {
  double fresnel, exponent;
};
PathWeight path_weight(const AzimuthalLobe& lobe, double inverse_index, double sin_gamma, double cos_gamma) {
  if (lobe.lobe == 0) {
    return {hair_fresnel(lobe.fresnel, lobe.ior, lobe.half_vector_cosine.value_or(lobe.cos_theta_d * cos_gamma)), 0.0};
  }
  const double cosine = lobe.cos_theta_d * cos_gamma;
  const double f = hair_fresnel(lobe.fresnel, lobe.ior, cosine);
  const double through = hair_transmittance(lobe.fresnel, lobe.ior, cosine);
  const double cos_inner = cosine_of(std::min(1.0, std::abs(sin_gamma) * inverse_index));
  double length = cos_inner / std::max(lobe.cos_theta_t, smallest_base);
  // exp(-2μ length) is C^(length/2).
  if (lobe.absorption == HairAbsorption::printed) length *= 2.0 * cos_inner;
  return {through * through * std::pow(f, lobe.lobe - 1), 0.5 * length * lobe.lobe};
}

/// Sums per channel; grey colours use the first alone.
using Channels = std::array<double, 3>;
std::size_t channel_count(const Rgb& color) { return color.x == color.y && color.x == color.z ? 1 : 3; }
Rgb to_rgb(const Channels& sums, std::size_t channels) {
  return channels == 1 ? Rgb{sums[0], sums[0], sums[0]} : Rgb{sums[0], sums[1], sums[2]};
}

struct RuleResult {
  Channels sum{}, error{};
};
template <class Integrand>
RuleResult gauss_kronrod_21(const Integrand& integrand, double low, double high, std::size_t channels) {
  using Kronrod = boost::math::quadrature::gauss_kronrod<double, 21>;
  using Gauss = boost::math::quadrature::gauss<double, 10>;
  const double centre = 0.5 * (low + high), half = 0.5 * (high - low);
  Channels kronrod{}, gauss{};
  for (std::size_t k = 0; k < Kronrod::abscissa().size(); ++k) {
    const double x = half * Kronrod::abscissa()[k];
    Channels value = integrand(centre + x);
    if (k > 0) {
      const Channels mirrored = integrand(centre - x);
      for (std::size_t c = 0; c < channels; ++c) value[c] += mirrored[c];
    }
    // The ten Gauss points are every other one of the twenty-one, from the second.
    const double gauss_weight = k % 2 == 1 ? Gauss::weights()[k / 2] : 0.0;
    for (std::size_t c = 0; c < channels; ++c) {
      kronrod[c] += Kronrod::weights()[k] * value[c];
      gauss[c] += gauss_weight * value[c];
    }
  }
  RuleResult result;
  for (std::size_t c = 0; c < channels; ++c) {
    result.sum[c] = half * kronrod[c];
    result.error[c] = half * std::abs(kronrod[c] - gauss[c]);
  }
  return result;
}

/// Adds the integral over [low, high] to `sums`, halving while the error of a part exceeds `tolerances`. Where `stalls`
/// halvings in turn have not halved the error, what is left is rounding.
template <class Integrand>
void add_integral(const Integrand& integrand, double low, double high, const RuleResult& whole,
                  const Channels& tolerances, std::size_t channels, int stalls, Channels& sums) {
  const double middle = 0.5 * (low + high);
  bool fine = stalls == 0 || !(middle > low && middle < high);
  if (!fine) {
    fine = true;
    for (std::size_t c = 0; c < channels; ++c) fine = fine && whole.error[c] <= tolerances[c];
  }
  if (fine) {
    for (std::size_t c = 0; c < channels; ++c) sums[c] += whole.sum[c];
    return;
  }
  const RuleResult left = gauss_kronrod_21(integrand, low, middle, channels);
  const RuleResult right = gauss_kronrod_21(integrand, middle, high, channels);
  bool gained = false;
  for (std::size_t c = 0; c < channels; ++c) {
    gained = gained || left.error[c] + right.error[c] <= 0.5 * whole.error[c];
  }
  const int left_over = gained ? allowed_stalls : stalls - 1;
  add_integral(integrand, low, middle, left, tolerances, channels, left_over, sums);
  add_integral(integrand, middle, high, right, tolerances, channels, left_over, sums);
}

/// The integral between all knots, to `relative` of itself; the integrand is not negative.
template <class Integrand>
Channels integrate(const Integrand& integrand, const std::vector<double>& knots, std::size_t channels,
                   double relative) {
  std::vector<RuleResult> parts(knots.size() - 1);
  Channels total{}, sums{};
  for (std::size_t k = 0; k < parts.size(); ++k) {
    parts[k] = gauss_kronrod_21(integrand, knots[k], knots[k + 1], channels);
    for (std::size_t c = 0; c < channels; ++c) total[c] += parts[k].sum[c];
  }
  for (std::size_t c = 0; c < channels; ++c) total[c] *= relative;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    add_integral(integrand, knots[k], knots[k + 1], parts[k], total, channels, allowed_stalls, sums);
  }
  return sums;
}

/// Distances from the detector's centre at which its density has fallen in steps that one rule can follow, from
/// `nearest` outwards.
std::array<double, 5> detector_flanks(HairDetector detector, double deviation, double nearest) {
  if (detector == HairDetector::gaussian) {
    // Exponents that grow by ½, 3, 10, 24, 40 over the nearest point's.
    std::array<double, 5> distances{0.5, 3.0, 10.0, 24.0, 40.0};
    for (double& d : distances) d = std::sqrt(nearest * nearest + 2.0 * deviation * deviation * d);
    return distances;
  }
  std::array<double, 5> distances{1.5, 4.0, 10.0, 22.0, 40.0};
  for (double& d : distances) d = nearest + deviation * (std::sqrt(3.0) / pi) * d;
  return distances;
}

/// γi between which the integrand of N_p(phi) is smooth on the scale of the interval.
std::vector<double> azimuthal_knots(const Rays& rays, const AzimuthalLobe& lobe, double phi) {
  const std::vector<double> pieces = rays.monotone_knots();
  std::vector<double> knots = pieces;
  if (lobe.deviation > widest_summed) return knots;
  const double turn = 2.0 * pi;
  for (std::size_t k = 0; k + 1 < pieces.size(); ++k) {
    const double low = pieces[k], high = pieces[k + 1];
    const double from = rays.exit(low), to = rays.exit(high);
    const double least = std::min(from, to), most = std::max(from, to);
    const auto add = [&](double target) {
      if (target > least && target < most) knots.push_back(rays.solve(low, high, target, 0.02 * lobe.deviation));
    };
    // Every turn of the detector's centre inside the range, and the nearest on either side.
    for (double centre = phi + turn * std::floor((least - phi) / turn); centre < most + turn; centre += turn) {
      const double nearest = centre < least ? least - centre : centre > most ? centre - most : 0.0;
      add(centre);
      for (const double distance : detector_flanks(lobe.detector, lobe.deviation, nearest)) {
        add(centre - distance);
        add(centre + distance);
      }
    }
  }
  std::sort(knots.begin(), knots.end());
  return knots;
}

}  // namespace

double bessel_i0_scaled(double x) {
  x = std::abs(x);
  if (x < 30.0) return boost::math::cyl_bessel_i(0, x) * std::exp(-x);
  // Abramowitz & Stegun 9.7.1; its terms fall until the 2x-th, which is far below rounding here.
  double term = 1.0, sum = 1.0;
  for (int k = 1; k < 40 && term > 1e-17; ++k) {
    term *= (2 * k - 1) * (2 * k - 1) / (8.0 * k * x);
    sum += term;
  }
  return sum / std::sqrt(2.0 * pi * x);
}

double log_bessel_i0(double x) { return std::abs(x) + std::log(bessel_i0_scaled(x)); }

double longitudinal_scattering(double variance, const Inclination& i, const Inclination& r) {
  const double v = std::max(variance, smallest_variance);
  // 1 - cos(θi + θr), from the sine where the cosine is near 1.
  const double cosine = i.cosine * r.cosine - i.sine * r.sine, sine = i.sine * r.cosine + i.cosine * r.sine;
  const double rise = cosine > 0.0 ? sine * sine / (1.0 + cosine) : 1.0 - cosine;
  return bessel_i0_scaled(i.cosine * r.cosine / v) * std::exp(-rise / v) / (-v * std::expm1(-2.0 / v));
}

double longitudinal_scattering(double variance, double sin_theta_i, double sin_theta_r) {
  return longitudinal_scattering(variance, {sin_theta_i, cosine_of(sin_theta_i)},
                                 {sin_theta_r, cosine_of(sin_theta_r)});
}

double bravais_index(double ior, double cos_theta_d) { return 1.0 / inverse_bravais_index(ior, cos_theta_d); }

double exit_azimuth(int lobe, double bravais, double h) {
  return 2.0 * lobe * std::asin(h / bravais) - 2.0 * std::asin(h) + lobe * pi;
}

double exit_density(int lobe, double bravais, double h) {
  // dΦ/dh = 2p/√(η'² - h²) - 2/√(1 - h²), both roots multiplied out so that h = ±1 gives 0.
  const double outer = cosine_of(h), inner = sqrt((bravais - h) * (bravais + h));
  return outer * inner / (2.0 * std::abs(lobe * outer - inner));
}

std::optional<double> caustic_offset(int lobe, double bravais) {
  if (lobe < 2 || !(bravais < lobe)) return {};
  return sqrt((lobe - bravais) * (lobe + bravais) / (lobe * lobe - 1.0));
}

std::vector<double> exit_offsets(int lobe, double bravais, double phi) {
  const Rays rays{lobe, 1.0 / bravais};
  const std::vector<double> pieces = rays.monotone_knots();
  std::vector<double> offsets;
  for (std::size_t k = 0; k + 1 < pieces.size(); ++k) {
    const double from = rays.exit(pieces[k]), to = rays.exit(pieces[k + 1]);
    const double least = std::min(from, to), most = std::max(from, to);
    for (double target = phi + 2.0 * pi * std::ceil((least - phi) / (2.0 * pi)); target <= most; target += 2.0 * pi) {
      offsets.push_back(std::sin(rays.solve(pieces[k], pieces[k + 1], target, 1e-15)));
    }
  }
  std::sort(offsets.begin(), offsets.end());
  return offsets;
}

double tt_offset(double bravais, double phi) {
  const double a = 1.0 / bravais, sign = phi < 0.0 ? -1.0 : 1.0;
  return sign * std::cos(0.5 * phi) / std::sqrt(1.0 + a * a - 2.0 * a * sign * std::sin(0.5 * phi));
}

double tt_azimuth_limit(double bravais) { return 2.0 * std::asin(1.0 / bravais); }

double hair_fresnel(HairFresnel fresnel, double ior, double cosine) {
  const double c = std::min(1.0, std::max(0.0, cosine));
  if (fresnel == HairFresnel::schlick) {
    const double f0 = square((1.0 - ior) / (1.0 + ior));
    return f0 + (1.0 - f0) * pow5(1.0 - c);
  }
  if (ior == 1.0) return 0.0;
  const double inner = std::sqrt((ior - 1.0) * (ior + 1.0) + c * c);  // η times the cosine of refraction
  const double s = (inner - c) / (inner + c), p = (ior * ior * c - inner) / (ior * ior * c + inner);
  return 0.5 * (s * s + p * p);
}

double hair_transmittance(HairFresnel fresnel, double ior, double cosine) {
  const double c = std::min(1.0, std::max(0.0, cosine));
  if (fresnel == HairFresnel::schlick) {
    if (c == 1.0) return 1.0 - square((1.0 - ior) / (1.0 + ior));
    return 4.0 * ior / square(1.0 + ior) * -std::expm1(5.0 * std::log1p(-c));
  }
  if (ior == 1.0) return 1.0;
  const double inner = std::sqrt((ior - 1.0) * (ior + 1.0) + c * c), squared = ior * ior;
  return 2.0 * c * inner * (1.0 / square(inner + c) + squared / square(squared * c + inner));
}

double hair_absorption(double color) { return -0.25 * std::log(color); }

double gaussian_density(double deviation, double x) {
  return std::exp(-0.5 * square(x / deviation)) / (deviation * std::sqrt(2.0 * pi));
}

double logistic_density(double scale, double x) {
  const double e = std::exp(-std::abs(x) / scale);
  return e / (scale * (1.0 + e) * (1.0 + e));
}

double wrapped_detector(HairDetector detector, double deviation, double x) {
  x = std::remainder(x, 2.0 * pi);
  const double scale = deviation * std::sqrt(3.0) / pi;
  const auto density = [&](double t) {
    return detector == HairDetector::gaussian ? gaussian_density(deviation, t) : logistic_density(scale, t);
  };
  if (deviation > widest_summed) {
    // Too many turns overlap: the Fourier series, whose first terms are all there is.
    double sum = 1.0, coefficient = 1.0;
    for (int n = 1; coefficient > 1e-18; ++n) {
      const double y = n * pi * scale;
      coefficient = detector == HairDetector::gaussian ? std::exp(-0.5 * square(n * deviation)) : y / std::sinh(y);
      sum += 2.0 * coefficient * std::cos(n * x);
    }
    return sum / (2.0 * pi);
  }
  double sum = density(x);
  for (double turn = 2.0 * pi;; turn += 2.0 * pi) {
    const double more = density(x - turn) + density(x + turn);
    sum += more;
    // What is left falls at least as fast as a logistic's tail; past this it is below rounding.
    if (!(more > 1e-20 * sum)) return sum;
  }
}

Rgb hair_attenuation(const AzimuthalLobe& lobe, const Rgb& color, double h) {
  const PathWeight weight = path_weight(lobe, inverse_bravais_index(lobe.ior, lobe.cos_theta_d), h, cosine_of(h));
  const auto channel = [&](double c) {
    return weight.exponent == 0.0 ? weight.fresnel : weight.fresnel * std::pow(c, weight.exponent);
  };
  return {channel(color.x), channel(color.y), channel(color.z)};
}

Rgb azimuthal_sample(const AzimuthalLobe& lobe, const Rgb& color, double phi, double h) {
  const Rays rays{lobe.lobe, inverse_bravais_index(lobe.ior, lobe.cos_theta_d)};
  return hair_attenuation(lobe, color, h) *
         wrapped_detector(lobe.detector, lobe.deviation, phi - rays.exit(std::asin(h)));
}

namespace {

/// γi ↦ A cosγi weight(γi) per channel.
template <class Weight>
auto attenuation_times(const AzimuthalLobe& lobe, const Rgb& color, double inverse_index, const Weight& weight) {
  return [&, inverse_index, channels = channel_count(color), rgb = Channels{color.x, color.y, color.z}](double gamma) {
    Channels values{};
    const double sine = std::sin(gamma), cosine = std::max(0.0, std::cos(gamma));
    const double w = weight(gamma);
    if (w == 0.0) return values;
    const PathWeight path = path_weight(lobe, inverse_index, sine, cosine);
    for (std::size_t c = 0; c < channels; ++c) {
      values[c] = w * cosine * path.fresnel * (path.exponent == 0.0 ? 1.0 : std::pow(rgb[c], path.exponent));
    }
    return values;
  };
}

}  // namespace

Rgb azimuthal_scattering(const AzimuthalLobe& lobe, const Rgb& color, double phi) {
  const Rays rays{lobe.lobe, inverse_bravais_index(lobe.ior, lobe.cos_theta_d)};
  const auto detector = [&](double gamma) {
    return wrapped_detector(lobe.detector, lobe.deviation, phi - rays.exit(gamma));
  };
  const std::size_t channels = channel_count(color);
  const double relative = std::max(1e-12, 1e-13 / lobe.deviation);
  return 0.5 * to_rgb(integrate(attenuation_times(lobe, color, rays.inverse_index, detector),
                                azimuthal_knots(rays, lobe, phi), channels, relative),
                      channels);
}

Rgb azimuthal_albedo(const AzimuthalLobe& lobe, const Rgb& color) {
  const auto all = [](double) { return 1.0; };
  const std::size_t channels = channel_count(color);
  return 0.5 * to_rgb(integrate(attenuation_times(lobe, color, inverse_bravais_index(lobe.ior, lobe.cos_theta_d), all),
                                {-0.5 * pi, 0.0, 0.5 * pi}, channels, 1e-14),
                      channels);
}

}  // namespace lobefit
