// The hair reference against closed forms, conservation laws, rays traced through a dielectric cylinder, an independent
// quadrature, and S3's formulas as they stand; its Monte Carlo estimates against its quadrature.
//
// The traced rays know nothing of inclinations, Bravais indices or Φ: they meet the cylinder x² + y² = 1 in space and
// are refracted by Snell's law for vectors.
//
// Statistical tests have fixed seeds. Unless stated otherwise, one in a million choices of seeds would fail them.
#include <gtest/gtest.h>

#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/bessel.hpp>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "reference/estimate.h"
#include "reference/hair/hair.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"

namespace lobefit {
namespace {

constexpr double false_alarm = 1e-6;
constexpr Rgb white{1.0, 1.0, 1.0};
constexpr Rgb brown{0.55, 0.3, 0.12};

const Reference& hair() {
  static const Reference reference = hair_reference();
  return reference;
}

using Settings = std::vector<std::pair<std::string, std::string>>;
ParameterValues fibre(const Settings& settings = {}) {
  ParameterValues values = hair().defaults();
  for (const auto& [name, text] : settings) values.set_text(name, text);
  return values;
}

/// Direction at an inclination from the normal plane.
Direction fibre_direction(double theta, double phi) {
  return {std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi), std::sin(theta)};
}
Inclination incline(double theta) { return {std::sin(theta), std::cos(theta)}; }
Direction random_direction(UniformNumbers& uniform) {
  return fibre_direction(std::asin(uniform.between(-1.0, 1.0)), uniform.between(0.0, 2.0 * pi));
}

double relative_error(double value, double truth) { return std::abs(value - truth) / std::abs(truth); }

/// ∫ f over [knots.front(), knots.back()], `order` points between knots.
double integrate(const std::vector<double>& knots, int order, const std::function<double(double)>& f) {
  double sum = 0.0;
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    for (const auto& [x, weight] : gauss_legendre(order, knots[k], knots[k + 1])) sum += weight * f(x);
  }
  return sum;
}

/// Knots on [-π/2, π/2] around a peak of width `deviation`.
std::vector<double> peaked_knots(double peak, double deviation) {
  std::vector<double> knots{-0.5 * pi, 0.5 * pi};
  for (const double d : {0.0, 1.5, 3.5, 6.0, 10.0, 30.0}) {
    for (const double x : {peak - d * deviation, peak + d * deviation}) {
      if (x > -0.5 * pi && x < 0.5 * pi) knots.push_back(x);
    }
  }
  std::sort(knots.begin(), knots.end());
  return knots;
}

// ---- longitudinal -----------------------------------------------------------------------------------------------

TEST(HairLongitudinal, ScaledBesselAgreesWithBoostAcrossTheSwitch) {
  for (double x = 1e-3; x < 600.0; x *= 1.07) {
    const double boost = std::log(boost::math::cyl_bessel_i(0, x));
    EXPECT_NEAR(log_bessel_i0(x), boost, 2e-15 * std::max(1.0, x)) << x;
    EXPECT_LT(relative_error(bessel_i0_scaled(x), boost::math::cyl_bessel_i(0, x) * std::exp(-x)), 4e-13) << x;
  }
  EXPECT_EQ(bessel_i0_scaled(0.0), 1.0);
  EXPECT_NEAR(bessel_i0_scaled(1e12) * std::sqrt(2.0 * pi * 1e12), 1.0, 1e-12);
}

TEST(HairLongitudinal, IntegratesToOneForEveryVarianceAndView) {
  double worst = 0.0;
  for (const double v : {1e-10, 1e-8, 1e-6, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0}) {
    for (const double theta : {-90.0, -89.9, -85.0, -60.0, -20.0, 0.0, 10.0, 45.0, 75.0, 89.0, 90.0}) {
      const Inclination r = incline(radians(theta));
      const double total = integrate(peaked_knots(-radians(theta), std::sqrt(v)), 40,
                                     [&](double x) { return longitudinal_scattering(v, incline(x), r) * std::cos(x); });
      // The rounding of θ itself moves a needle by 1e-16/√v of its width, here at either flank.
      EXPECT_NEAR(total, 1.0, 1e-12 + 1e-15 / std::sqrt(v)) << "v " << v << ", theta " << theta;
      worst = std::max(worst, std::abs(total - 1.0));
    }
  }
  std::printf("  largest |∫ M cosθ dθ - 1|: %.2g\n", worst);
}

TEST(HairLongitudinal, IsAVonMisesFisherDistributionOverTheSphere) {
  // M = ∫ exp(w·a/v)/(4πv sinh(1/v)) dφ, a the mirrored direction: no Bessel function in it. The rule is exact to
  // rounding for periodic integrands.
  for (const double v : {0.01, 0.05, 0.2, 1.0, 5.0}) {
    for (const double i : {-80.0, -30.0, 0.0, 20.0, 65.0}) {
      for (const double r : {-70.0, -10.0, 35.0, 85.0}) {
        const Direction a = fibre_direction(-radians(i), 0.0);
        constexpr int points = 400;
        double sum = 0.0;
        for (int k = 0; k < points; ++k) {
          sum += std::exp((dot(fibre_direction(radians(r), 2.0 * pi * k / points), a) - 1.0) / v);
        }
        const double expected = sum * 2.0 * pi / points / (2.0 * pi * v * -std::expm1(-2.0 / v));
        EXPECT_LT(relative_error(longitudinal_scattering(v, incline(radians(i)), incline(radians(r))), expected), 1e-11)
            << v << " " << i << " " << r;
      }
    }
  }
}

TEST(HairLongitudinal, IsThePrintedFormWhereThatDoesNotOverflow) {
  for (const double v : {0.004, 0.02, 0.1, 0.5, 4.0}) {
    for (const double si : {-0.9, -0.2, 0.0, 0.7}) {
      for (const double sr : {-0.8, 0.1, 0.95}) {
        const double ci = std::sqrt(1.0 - si * si), cr = std::sqrt(1.0 - sr * sr);
        const double printed = 1.0 / (v * std::exp(2.0 / v) - v) * std::exp((1.0 - si * sr) / v) *
                               boost::math::cyl_bessel_i(0, ci * cr / v);
        const double value = longitudinal_scattering(v, si, sr);
        EXPECT_LT(relative_error(value, printed), 1e-12 / v) << v << " " << si << " " << sr;
        EXPECT_EQ(value, longitudinal_scattering(v, sr, si));
      }
    }
  }
}

TEST(HairLongitudinal, UnrealsLogarithmOfI0IsHalfAPercentLowWhereItSwitches) {
  // S3: a + 0.5 (-log(2π) + log(1/a) + 0.125/a) for a > 12.
  const double a = 12.0;
  const double unreal = a + 0.5 * (-std::log(2.0 * pi) + std::log(1.0 / a) + 0.125 / a);
  EXPECT_NEAR(std::exp(unreal - log_bessel_i0(a)) - 1.0, -0.0057, 1e-4);
}

// ---- the cross-section ------------------------------------------------------------------------------------------

TEST(HairCrossSection, BravaisIndexFitOfUnrealErrsByTheStatedAmount) {
  // η' ≈ 1.19/cosθd + 0.36 cosθd at η = 1.55, "error < 0.68 %".
  double worst = 0.0, at = 0.0;
  for (double theta = 0.0; theta < 90.0; theta += 0.01) {
    const double c = std::cos(radians(theta));
    const double error = relative_error(1.19 / c + 0.36 * c, bravais_index(1.55, c));
    if (error > worst) worst = error, at = theta;
  }
  std::printf("  largest error of Unreal's η': %.4f %% at θd = %.2f°\n", 100.0 * worst, at);
  EXPECT_NEAR(worst, 0.00675, 5e-6);
  EXPECT_NEAR(at, 45.0, 0.5);
}

TEST(HairCrossSection, ExactTransmittedOffsetIsTheRootOfTheExitAzimuth) {
  for (const double index : {1.2, 1.55, 2.4, 9.0}) {
    const double limit = tt_azimuth_limit(index);
    for (int k = 0; k <= 50; ++k) {
      const double phi = limit + (pi - limit) * k / 50.0;
      for (const double sign : {-1.0, 1.0}) {
        const double h = tt_offset(index, sign * phi);
        EXPECT_LE(std::abs(h), 1.0 + 1e-15);
        const double exit = exit_azimuth(1, index, std::min(1.0, std::max(-1.0, h)));
        // At the limit h = 1, where asin has no derivative.
        EXPECT_NEAR(std::remainder(exit - sign * phi, 2.0 * pi), 0.0, k == 0 ? 1e-7 : 1e-13) << index << " " << phi;
      }
      const double h = tt_offset(index, phi), c = std::cos(phi), a = 1.0 / index;
      EXPECT_NEAR(h * h, (0.5 + 0.5 * c) / (1.0 + a * a - 2.0 * a * sqrt(0.5 - 0.5 * c)), 1e-13);
    }
    // Nearer to the retro side no ray leaves, though the formula has a value.
    EXPECT_TRUE(exit_offsets(1, index, 0.9 * limit).empty());
    EXPECT_LT(tt_offset(index, 0.9 * limit), 1.0);
  }
}

TEST(HairCrossSection, OffsetsOfEveryLobeLeaveWhereAsked) {
  UniformNumbers uniform(11);
  for (int trial = 0; trial < 300; ++trial) {
    const int lobe = trial % 5;
    const double index = uniform.between(1.05, 3.0), phi = uniform.between(-pi, pi);
    const std::vector<double> offsets = exit_offsets(lobe, index, phi);
    // As many as a walk over the width meets, but for pairs that it steps across beside a caustic.
    constexpr int steps = 20000;
    std::size_t met = 0;
    double before = 0.0;
    for (int k = 0; k <= steps; ++k) {
      const double past = std::remainder(exit_azimuth(lobe, index, 2.0 * k / steps - 1.0) - phi, 2.0 * pi);
      if (k > 0 && std::abs(past) < 1.0 && (past > 0.0) != (before > 0.0)) ++met;
      before = past;
    }
    bool beside_caustic = false;
    for (const double h : offsets) beside_caustic = beside_caustic || exit_density(lobe, index, h) > 500.0;
    if (!beside_caustic) {
      EXPECT_EQ(offsets.size(), met) << lobe << " " << index << " " << phi;
    }
    if (lobe == 0) {
      EXPECT_NEAR(offsets.at(0), -std::sin(0.5 * phi), 1e-14);
    }
    for (const double h : offsets) {
      EXPECT_NEAR(std::remainder(exit_azimuth(lobe, index, h) - phi, 2.0 * pi), 0.0, 1e-12);
      const double step = 1e-6 * (1.0 - std::abs(h));
      const double slope = (exit_azimuth(lobe, index, h + step) - exit_azimuth(lobe, index, h - step)) / (2.0 * step);
      if (std::abs(slope) > 0.05 && std::abs(h) < 0.999) {
        EXPECT_NEAR(exit_density(lobe, index, h) * std::abs(slope), 1.0, 1e-5);
      }
    }
    if (const std::optional<double> h = caustic_offset(lobe, index)) {
      EXPECT_GT(exit_density(lobe, index, *h), 1e6) << lobe << " " << index;
    }
  }
  EXPECT_FALSE(caustic_offset(2, 2.01));
  EXPECT_FALSE(caustic_offset(1, 1.5));
}

/// Unpolarised share reflected, by the sine and tangent laws; `inside` the cosine is of the ray in the fibre.
double textbook_fresnel(double ior, double cosine, bool inside) {
  const double a = std::acos(std::min(1.0, cosine));
  if (a < 1e-6) return square((ior - 1.0) / (ior + 1.0));
  const double b = std::asin(std::sin(a) * (inside ? ior : 1.0 / ior));
  return 0.5 * (square(std::sin(a - b) / std::sin(a + b)) + square(std::tan(a - b) / std::tan(a + b)));
}

TEST(HairCrossSection, FresnelIsTheTextbooksAndMarschnersPairOfIndices) {
  for (const double ior : {1.1, 1.55, 2.5}) {
    for (double c = 0.01; c < 1.0; c += 0.01) {
      EXPECT_LT(relative_error(hair_fresnel(HairFresnel::dielectric, ior, c), textbook_fresnel(ior, c, false)), 1e-10);
      for (const HairFresnel fresnel : {HairFresnel::schlick, HairFresnel::dielectric}) {
        EXPECT_NEAR(hair_transmittance(fresnel, ior, c), 1.0 - hair_fresnel(fresnel, ior, c), 4e-16);
      }
    }
    for (const double theta : {0.0, 0.4, 1.2, 1.5}) {
      for (const double h : {0.0, 0.3, 0.8, 0.99}) {
        const double cos_i = std::sqrt(1.0 - h * h), perpendicular = bravais_index(ior, std::cos(theta));
        const double parallel = ior * ior / perpendicular;
        const double cos_t = std::sqrt(1.0 - square(h / perpendicular));
        const double s = (cos_i - perpendicular * cos_t) / (cos_i + perpendicular * cos_t);
        const double p = (parallel * cos_i - cos_t) / (parallel * cos_i + cos_t);
        EXPECT_LT(
            relative_error(hair_fresnel(HairFresnel::dielectric, ior, std::cos(theta) * cos_i), 0.5 * (s * s + p * p)),
            1e-11);
      }
    }
    EXPECT_EQ(hair_fresnel(HairFresnel::schlick, ior, 0.0), 1.0);
    EXPECT_NEAR(hair_fresnel(HairFresnel::schlick, ior, 1.0), hair_fresnel(HairFresnel::dielectric, ior, 1.0), 1e-15);
  }
  EXPECT_EQ(hair_fresnel(HairFresnel::dielectric, 1.0, 0.0), 0.0);
  EXPECT_NEAR(hair_transmittance(HairFresnel::schlick, 1.5, 1e-12), 0.96 * 5e-12, 1e-22);
}

// ---- traced rays ------------------------------------------------------------------------------------------------

Direction refracted(const Direction& d, const Direction& against, double index_ratio) {
  const double c = -dot(d, against);
  const double inner = std::sqrt(1.0 - index_ratio * index_ratio * (1.0 - c * c));
  return index_ratio * d + (index_ratio * c - inner) * against;
}

/// A ray that left the cylinder x² + y² = 1.
struct TracedRay {
  Direction out;
  double fresnel = 1.0;  // product of the shares along the path
  double length = 0.0;   // inside
  int segments = 0;
};

/// Follows the ray that comes from `light` (azimuth 0) at offset h. leave(F, segments) decides at every interface
/// whether the ray ends up outside there: reflected at the first, transmitted at the others.
template <class Leave>
TracedRay trace(double ior, const Direction& light, double h, const Leave& leave) {
  TracedRay ray;
  Direction at{std::sqrt(1.0 - h * h), -h, 0.0};
  Direction d = -light;
  double f = textbook_fresnel(ior, dot(light, at), false);
  if (leave(f, 0)) {
    ray.out = d - 2.0 * dot(d, at) * at;
    ray.fresnel = f;
    return ray;
  }
  ray.fresnel = 1.0 - f;
  d = refracted(d, at, 1.0 / ior);
  while (true) {
    const double distance = -2.0 * (at.x * d.x + at.y * d.y) / (d.x * d.x + d.y * d.y);
    at = at + distance * d;
    ray.length += distance;
    ++ray.segments;
    const Direction outward = Direction{at.x, at.y, 0.0} / std::hypot(at.x, at.y);
    f = textbook_fresnel(ior, dot(d, outward), true);
    if (leave(f, ray.segments)) {
      ray.out = refracted(d, -outward, ior);
      ray.fresnel *= 1.0 - f;
      return ray;
    }
    ray.fresnel *= f;
    d = d - 2.0 * dot(d, outward) * outward;
  }
}

TEST(HairTracedRays, LeaveWhereTheFormulasSayWithTheWeightTheySay) {
  UniformNumbers uniform(5);
  double printed_least = 10.0, printed_most = 0.0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int lobe = trial % 5;
    const double ior = uniform.between(1.1, 2.2), theta = uniform.between(-1.4, 1.4);
    const double h = uniform.between(-0.995, 0.995), color = uniform.between(0.05, 0.95);
    const TracedRay ray =
        trace(ior, fibre_direction(theta, 0.0), h, [&](double, int segments) { return segments == lobe; });
    // On the specular cone θo = -θi, hence θd = θi.
    EXPECT_NEAR(ray.out.z, -std::sin(theta), 1e-12);
    const double bravais = bravais_index(ior, std::cos(theta));
    EXPECT_NEAR(std::remainder(std::atan2(ray.out.y, ray.out.x) - exit_azimuth(lobe, bravais, h), 2.0 * pi), 0.0, 1e-9);

    AzimuthalLobe azimuthal{.lobe = lobe,
                            .ior = ior,
                            .cos_theta_d = std::cos(theta),
                            .cos_theta_t = std::sqrt(1.0 - square(std::sin(theta) / ior))};
    const double absorbed = std::exp(-hair_absorption(color) * ray.length);
    EXPECT_LT(relative_error(hair_attenuation(azimuthal, {color, color, color}, h).x, ray.fresnel * absorbed), 1e-9);

    if (lobe > 0) {  // S3's text: the length it stands for, over the true one
      azimuthal.absorption = HairAbsorption::printed;
      const double length =
          std::log(hair_attenuation(azimuthal, {color, color, color}, h).x / ray.fresnel) / -hair_absorption(color);
      printed_least = std::min(printed_least, length / ray.length);
      printed_most = std::max(printed_most, length / ray.length);
    }
  }
  std::printf("  path length of the printed absorption over the traced one: %.3f ... %.3f\n", printed_least,
              printed_most);
  EXPECT_GT(printed_most, 1.99);  // 2 cosγt
}

TEST(HairTracedRays, HistogramsOfExitAzimuthsAreTheAzimuthalFunctions) {
  constexpr int rays = 400000, bins = 24;
  for (const double theta : {0.0, 0.7, 1.2}) {
    const double ior = 1.55, deviation = 0.12;
    UniformNumbers uniform(static_cast<std::uint64_t>(100.0 * theta) + 3);
    std::array<std::array<int, bins>, 3> counts{};
    int beyond = 0;
    for (int k = 0; k < rays; ++k) {
      const TracedRay ray = trace(ior, fibre_direction(theta, 0.0), uniform.between(-1.0, 1.0),
                                  [&](double f, int segments) { return (uniform() < f) == (segments == 0); });
      // The detector: Box and Muller's normal deviate.
      const double jitter = deviation * std::sqrt(-2.0 * std::log(1.0 - uniform())) * std::cos(2.0 * pi * uniform());
      const double turn = (std::atan2(ray.out.y, ray.out.x) + jitter) / (2.0 * pi) + 2.5;
      if (ray.segments > 2) {
        ++beyond;
      } else {
        ++counts[static_cast<std::size_t>(ray.segments)][static_cast<std::size_t>((turn - std::floor(turn)) * bins)];
      }
    }
    double chi_squared = 0.0, rest = 1.0;
    int cells = 0;
    const auto add = [&](double count, double probability) {
      rest -= probability;
      const double expected = probability * rays;
      // A cell with fewer is not normal enough; all of them together stay below one part in a thousand.
      if (expected < 10.0) {
        EXPECT_LT(count, 40.0);
        return;
      }
      chi_squared += square(count - expected) / expected;
      ++cells;
    };
    for (int lobe = 0; lobe < 3; ++lobe) {
      const AzimuthalLobe azimuthal{.lobe = lobe, .ior = ior, .cos_theta_d = std::cos(theta), .deviation = deviation};
      for (int bin = 0; bin < bins; ++bin) {
        const double from = 2.0 * pi * (static_cast<double>(bin) / bins - 0.5);
        const double probability = integrate({from, from + 2.0 * pi / bins}, 12,
                                             [&](double phi) { return azimuthal_scattering(azimuthal, white, phi).x; });
        add(counts[static_cast<std::size_t>(lobe)][static_cast<std::size_t>(bin)], probability);
      }
    }
    add(beyond, rest);
    const boost::math::chi_squared distribution(cells - 1);
    EXPECT_LT(chi_squared, quantile(complement(distribution, 0.5 * false_alarm))) << theta;
    EXPECT_GT(chi_squared, quantile(distribution, 0.5 * false_alarm)) << theta;
    std::printf("  θ = %.1f: chi² %.1f on %d cells\n", theta, chi_squared, cells);
  }
}

// ---- detectors and azimuthal functions --------------------------------------------------------------------------

/// The wrapped density by its Fourier series.
double detector_series(HairDetector detector, double deviation, double x) {
  double sum = 1.0;
  for (int n = 1; n < 4000; ++n) {
    const double y = n * deviation * std::sqrt(3.0);  // πns of the logistic
    const double coefficient =
        detector == HairDetector::gaussian ? std::exp(-0.5 * square(n * deviation)) : y / std::sinh(y);
    if (coefficient < 1e-18) break;
    sum += 2.0 * coefficient * std::cos(n * x);
  }
  return sum / (2.0 * pi);
}

/// The same turn by turn.
double detector_turns(HairDetector detector, double deviation, double x) {
  double sum = 0.0;
  for (int turn = -60; turn <= 60; ++turn) {
    const double y = x + 2.0 * pi * turn;
    sum += detector == HairDetector::gaussian ? gaussian_density(deviation, y)
                                              : logistic_density(deviation * std::sqrt(3.0) / pi, y);
  }
  return sum;
}

TEST(HairDetector, IsNormalisedAndWraps) {
  for (const HairDetector detector : {HairDetector::gaussian, HairDetector::logistic}) {
    for (const double deviation : {0.02, 0.1, 0.5, 1.0, 2.0, 7.0}) {
      for (double x = -9.0; x < 9.0; x += 0.37) {
        EXPECT_NEAR(wrapped_detector(detector, deviation, x),
                    deviation > 2.0 ? detector_turns(detector, deviation, x) : detector_series(detector, deviation, x),
                    2e-14 / std::min(1.0, deviation))
            << deviation << " " << x;
      }
      // Trapezoids, exact for periodic integrands.
      constexpr int points = 2000;
      double sum = 0.0;
      for (int k = 0; k < points; ++k) sum += wrapped_detector(detector, deviation, 2.0 * pi * k / points);
      EXPECT_NEAR(sum * 2.0 * pi / points, 1.0, 1e-13);
    }
  }
  // S3's D in its own letters.
  const double s = 0.35, phi = 2.0, e = std::exp((phi - pi) / s);
  EXPECT_NEAR(logistic_density(s, phi - pi), e / (s * (1.0 + e) * (1.0 + e)), 1e-15);
}

TEST(HairAzimuthal, AgreesWithAPlainQuadratureOverTheFibre) {
  UniformNumbers uniform(21);
  const std::vector<QuadraturePoint> points = gauss_legendre(4000, -0.5 * pi, 0.5 * pi);
  double worst = 0.0;
  for (int trial = 0; trial < 60; ++trial) {
    const int lobe = trial % 4;
    const double theta_d = uniform.between(0.0, 1.5);
    const AzimuthalLobe a{.lobe = lobe,
                          .ior = uniform.between(1.02, 2.5),
                          .cos_theta_d = std::cos(theta_d),
                          .cos_theta_t = uniform.between(0.3, 1.0),
                          .deviation = 0.02 * std::pow(100.0, uniform()),
                          .fresnel = static_cast<HairFresnel>(trial / 2 % 2),
                          .absorption = static_cast<HairAbsorption>(trial / 4 % 2),
                          .detector = static_cast<HairDetector>(trial / 8 % 2)};
    const double phi = uniform.between(0.0, pi),
                 index = std::sqrt(square(a.ior / a.cos_theta_d) - square(std::tan(theta_d)));
    Rgb sum{};
    for (const auto& [gamma, weight] : points) {
      const double h = std::sin(gamma), inner = std::asin(h / index), c = a.cos_theta_d * std::cos(gamma);
      const double f0 = square((1.0 - a.ior) / (1.0 + a.ior));
      const double f = a.fresnel == HairFresnel::schlick ? f0 + (1.0 - f0) * std::pow(1.0 - c, 5.0)
                                                         : textbook_fresnel(a.ior, c, false);
      const double length = a.absorption == HairAbsorption::path_length
                                ? 2.0 * std::cos(inner) / a.cos_theta_t
                                : 2.0 * (1.0 + std::cos(2.0 * inner)) / a.cos_theta_t;
      const double d = detector_series(a.detector, a.deviation, phi - (2.0 * lobe * inner - 2.0 * gamma + lobe * pi));
      const auto channel = [&](double color) {
        if (lobe == 0) return f;
        return (1.0 - f) * (1.0 - f) * std::pow(f, lobe - 1) * std::exp(0.25 * std::log(color) * length * lobe);
      };
      sum = sum + weight * 0.5 * std::cos(gamma) * d * Rgb{channel(brown.x), channel(brown.y), channel(brown.z)};
    }
    const Rgb value = azimuthal_scattering(a, brown, phi);
    // The series cancels to 1e-16 of the peak.
    const double floor = 1e-15 * std::max(1.0, 1.0 / a.deviation);
    for (const auto& [x, truth] : {std::pair{value.x, sum.x}, {value.y, sum.y}, {value.z, sum.z}}) {
      EXPECT_NEAR(x, truth, 1e-11 * truth + floor) << trial;
      if (truth > 1e-3) worst = std::max(worst, relative_error(x, truth));
    }
  }
  std::printf("  largest relative difference: %.2g\n", worst);
}

TEST(HairAzimuthal, AllPathsTogetherLoseNothing) {
  // Σ_{p ≤ P} A(p, h) = 1 - (1 - F) F^P for any F; over azimuth and offset the rest is ½ ∫ (1 - F) F^P dh.
  for (const HairFresnel fresnel : {HairFresnel::schlick, HairFresnel::dielectric}) {
    for (const double theta : {0.0, 0.5, 1.0, 1.4}) {
      for (const double deviation : {0.08, 0.4, 1.5}) {
        double total = 0.0;
        constexpr int last = 8, points = 160;
        AzimuthalLobe a{.cos_theta_d = std::cos(theta), .deviation = deviation, .fresnel = fresnel};
        for (a.lobe = 0; a.lobe <= last; ++a.lobe) {
          double sum = 0.0;
          for (int k = 0; k < points; ++k) {
            sum += azimuthal_scattering(a, white, 2.0 * pi * (k + 0.5) / points).x * 2.0 * pi / points;
          }
          EXPECT_NEAR(sum, azimuthal_albedo(a, white).x, 1e-12);
          total += sum;
        }
        const double residual = integrate({-0.5 * pi, 0.0, 0.5 * pi}, 60, [&](double gamma) {
          const double f = hair_fresnel(fresnel, a.ior, a.cos_theta_d * std::cos(gamma));
          return 0.5 * std::cos(gamma) * (1.0 - f) * std::pow(f, last);
        });
        EXPECT_NEAR(total + residual, 1.0, 1e-11) << theta << " " << deviation;
      }
    }
  }
}

TEST(HairAzimuthal, NarrowDetectorsApproachTheSmoothCylinder) {
  // N_p → Σ over rays of ½ A |dΦ/dh|⁻¹; a detector of width β differs by O(β²).
  for (const double deviation : {1e-3, 1e-5}) {
    double worst = 0.0;
    for (const double theta : {0.0, 0.8}) {
      for (int lobe = 0; lobe < 4; ++lobe) {
        const AzimuthalLobe a{.lobe = lobe, .cos_theta_d = std::cos(theta), .deviation = deviation};
        const double index = bravais_index(a.ior, a.cos_theta_d);
        for (const double phi : {0.05, 0.4, 1.1, 2.0, 2.6, 3.0}) {
          double smooth = 0.0;
          bool near_an_end = false;  // of the rays, or a caustic: there the limit is not smooth
          for (const double h : exit_offsets(lobe, index, phi)) {
            smooth += 0.5 * hair_attenuation(a, white, h).x * exit_density(lobe, index, h);
            near_an_end = near_an_end || std::abs(h) > 0.995 || exit_density(lobe, index, h) > 5.0;
          }
          const double value = azimuthal_scattering(a, white, phi).x;
          if (near_an_end || std::abs(phi - tt_azimuth_limit(index)) < 0.05) continue;
          EXPECT_NEAR(value, smooth, 1e-8 + (3e-9 + 400.0 * deviation * deviation) * smooth)
              << lobe << " " << phi << " " << theta;
          if (smooth > 0.0) worst = std::max(worst, relative_error(value, smooth));
        }
      }
    }
    std::printf("  β = %g: largest relative difference %.2g\n", deviation, worst);
  }
  // R in closed form: ¼ cos(φ/2) F.
  const AzimuthalLobe r{.deviation = 1e-4, .half_vector_cosine = 0.7};
  EXPECT_NEAR(azimuthal_scattering(r, white, 1.0).x,
              0.25 * std::cos(0.5) * hair_fresnel(HairFresnel::dielectric, 1.55, 0.7), 1e-9);
}

// ---- the reference ----------------------------------------------------------------------------------------------

/// S of S3's HairShadingRef, from its formulas as printed, in double and with many h.
Rgb unreal_formulas(double roughness, double ior, const Rgb& color, const Direction& light, const Direction& view) {
  const double sin_l = light.z, sin_v = view.z, shift = 0.035;
  const double cos_t = std::sqrt(1.0 - square(sin_l / ior));
  const double cos_d = std::cos(0.5 * std::abs(std::asin(sin_v) - std::asin(sin_l)));
  const Direction lp{light.x, light.y, 0.0}, vp{view.x, view.y, 0.0};
  const double cos_phi = dot(lp, vp) / std::sqrt(dot(lp, lp) * dot(vp, vp)), phi = std::acos(cos_phi);
  const double index = std::sqrt(ior * ior - 1.0 + cos_d * cos_d) / cos_d, f0 = square((1.0 - ior) / (1.0 + ior));
  const std::array alpha{-2.0 * shift, shift, 4.0 * shift};
  const std::array beta{square(roughness), 0.5 * square(roughness), 2.0 * square(roughness)};
  Rgb sum{};
  for (std::size_t p = 0; p < 3; ++p) {
    double b = beta[p], tilted = std::sin(std::asin(sin_v) - alpha[p]);
    if (p == 0) {
      // The tilt as geometry: the view mirrored at a normal between the azimuths, α above the normal plane.
      const Direction between = normalize(normalize(lp) + normalize(vp));
      const Direction normal{std::cos(alpha[0]) * between.x, std::cos(alpha[0]) * between.y, std::sin(alpha[0])};
      tilted = -(2.0 * dot(view, normal) * normal - view).z;
      b *= std::sqrt(2.0) * std::sqrt(0.5 + 0.5 * cos_phi);
    }
    const double v = b * b, cosines = std::sqrt((1.0 - sin_l * sin_l) * (1.0 - tilted * tilted));
    const double m = 1.0 / (std::exp(2.0 / v) * v - v) * std::exp((1.0 - sin_l * tilted) / v) *
                     boost::math::cyl_bessel_i(0, cosines / v);
    constexpr int count = 100000;
    Rgb n{};
    for (int k = 0; k < count; ++k) {
      const double h = 2.0 * (k + 0.5) / count - 1.0, yt = std::asin(h / index);
      double detector = 0.0;
      for (int turn = -4; turn <= 4; ++turn) {
        const double x = phi - (2.0 * static_cast<double>(p) * yt - 2.0 * std::asin(h) + static_cast<double>(p) * pi) -
                         2.0 * pi * turn;
        detector += std::exp(-0.5 * square(x / beta[p])) / (std::sqrt(2.0 * pi) * beta[p]);
      }
      const auto schlick = [&](double c) { return f0 + (1.0 - f0) * std::pow(1.0 - c, 5.0); };
      const auto attenuation = [&](double c) {
        if (p == 0) return schlick(std::sqrt(0.5 + 0.5 * dot(light, view)));
        const double f = schlick(cos_d * std::sqrt(1.0 - h * h));
        const double t = std::exp(-2.0 * (-0.25 * std::log(c) / cos_t) * std::cos(yt));
        return p == 1 ? square(1.0 - f) * t : square(1.0 - f) * f * t * t;
      };
      n = n + detector / count * Rgb{attenuation(color.x), attenuation(color.y), attenuation(color.z)};
    }
    sum = sum + m * n;
  }
  return sum;
}

TEST(HairReference, IsUnrealsReferenceByDefault) {
  UniformNumbers uniform(77);
  double worst = 0.0;
  for (int trial = 0; trial < 10; ++trial) {
    const double roughness = uniform.between(0.5, 0.9);
    const Direction light = fibre_direction(uniform.between(-1.2, 1.2), 0.3);
    const Direction view = fibre_direction(uniform.between(-1.2, 1.2), 0.3 + uniform.between(0.0, 2.2));
    const ParameterValues values = fibre({{"roughness", number_text(roughness)}, {"base_color", "0.55,0.3,0.12"}});
    const Rgb value = hair().make(values)->exact(light, view);
    const Rgb truth = unreal_formulas(roughness, 1.55, brown, light, view);
    for (const double error :
         {relative_error(value.x, truth.x), relative_error(value.y, truth.y), relative_error(value.z, truth.z)}) {
      EXPECT_LT(error, 1e-7) << trial;  // the plain sum over h converges as its power -3/2 at the edges
      worst = std::max(worst, error);
    }
  }
  std::printf("  largest relative difference: %.2g\n", worst);
}

/// Albedo ∫ S dω over the lights of one view.
double albedo(const ParameterValues& values, double theta_view) {
  const std::unique_ptr<const Integrator> integrator = hair().make(values);
  const HairFibre& hair_fibre = dynamic_cast<const HairFibre&>(*integrator);
  double sum = 0.0;
  const double r2 = square(values.get("roughness"));
  // ±φ are equal. Not trapezoids: Unreal's R has a kink at φ = π.
  for (const auto& [phi, weight] : gauss_legendre(r2 < 0.3 ? 64 : 32, 0.0, pi)) {
    const Direction view = fibre_direction(theta_view, 0.0);
    for (int lobe = 0; lobe < 3; ++lobe) {
      // Where M peaks, for the knots only.
      const bool turns = lobe == 0 && values.choice("form") == "unreal_reference";
      const double beta = r2 *
                          std::array{values.get("width_r"), values.get("width_tt"), values.get("width_trt")}[lobe] *
                          (turns ? std::sqrt(2.0) * std::cos(0.5 * phi) : 1.0);
      const double alpha =
          values.get("shift") * std::array{values.get("tilt_r"), values.get("tilt_tt"), values.get("tilt_trt")}[lobe];
      const double s = std::sin(theta_view);
      const double mean =
          turns
              ? std::asin(s - 2.0 * std::sin(alpha) *
                                  (std::cos(0.5 * phi) * std::cos(alpha) * std::cos(theta_view) + std::sin(alpha) * s))
              : theta_view - alpha;
      sum += 2.0 * weight * integrate(peaked_knots(-mean, beta), 8, [&](double theta) {
               const FibrePair pair = fibre_pair(fibre_direction(theta, phi), view);
               const double m = hair_fibre.longitudinal(lobe, pair);
               if (m * std::cos(theta) < 1e-13) return 0.0;
               return m * azimuthal_scattering(hair_fibre.azimuthal(lobe, pair), white, pair.phi).x * std::cos(theta);
             });
    }
  }
  return sum;
}

TEST(HairReference, ConservesEnergyToTheResidualWhenTheLobesAreAlike) {
  for (const std::string fresnel : {"schlick", "dielectric"}) {
    for (const double theta : {0.0, 0.9}) {
      const ParameterValues values = fibre({{"form", "d_eon"},
                                            {"shift", "0"},
                                            {"roughness", "0.6"},
                                            {"width_r", "1"},
                                            {"width_tt", "1"},
                                            {"width_trt", "1"},
                                            {"fresnel", fresnel}});
      // What goes on to TRRT and beyond: ½ ∫ (1 - F) F² dh at each θd.
      const double v = square(0.36);
      const double residual = integrate({-0.5 * pi, -0.25 * pi, 0.0, 0.25 * pi, 0.5 * pi}, 24, [&](double light) {
        const double c = std::cos(0.5 * (theta - light));
        return longitudinal_scattering(v, incline(light), incline(theta)) * std::cos(light) *
               integrate({-0.5 * pi, 0.0, 0.5 * pi}, 40, [&](double gamma) {
                 const double f = hair_fresnel(fresnel == "schlick" ? HairFresnel::schlick : HairFresnel::dielectric,
                                               1.55, c * std::cos(gamma));
                 return 0.5 * std::cos(gamma) * (1.0 - f) * f * f;
               });
      });
      const double value = albedo(values, theta);
      EXPECT_NEAR(value, 1.0 - residual, 1e-9) << fresnel << " " << theta;
      std::printf("  %s, θ = %.1f: albedo %.10f, residual %.6f\n", fresnel.c_str(), theta, value, residual);
    }
  }
}

TEST(HairReference, AlbedoOfWhiteHairExceedsOneInUnrealsFormOnly) {
  std::printf("  albedo of white hair at θ = 0, 30, 60, 80°\n");
  for (const std::string form : {"unreal_reference", "d_eon"}) {
    double most = 0.0;
    for (const std::string fresnel : {"schlick", "dielectric"}) {
      for (const std::string roughness : {"0.4", "0.7", "1"}) {
        std::printf("  %-16s %-10s r = %-4s", form.c_str(), fresnel.c_str(), roughness.c_str());
        for (const double theta : {0.0, 30.0, 60.0, 80.0}) {
          const double value =
              albedo(fibre({{"form", form}, {"fresnel", fresnel}, {"roughness", roughness}}), radians(theta));
          std::printf(" %.5f", value);
          EXPECT_GT(value, 0.5);
          most = std::max(most, value);
        }
        std::printf("\n");
      }
    }
    // The most is 1.0231 and 0.9959.
    if (form == "d_eon") {
      EXPECT_LT(most, 1.0);
    } else {
      EXPECT_NEAR(most, 1.0231, 1e-4);
    }
  }
}

TEST(HairReference, ReciprocityHoldsWithoutTiltInTheSeparableFormOnly) {
  UniformNumbers uniform(8);
  const auto worst_asymmetry = [&](const Settings& settings) {
    const std::unique_ptr<const Integrator> integrator = hair().make(fibre(settings));
    double worst = 0.0;
    for (int k = 0; k < 40; ++k) {
      const Direction a = fibre_direction(uniform.between(-1.2, 1.2), uniform.between(0.0, 2.0 * pi));
      const Direction b = fibre_direction(uniform.between(-1.2, 1.2), uniform.between(0.0, 2.0 * pi));
      const double there = integrator->exact(a, b).z, back = integrator->exact(b, a).z;
      worst = std::max(worst, std::abs(there - back) / (0.5 * (there + back)));
    }
    return worst;
  };
  const std::string blue = "0.55,0.3,0.12";
  const auto settings = [&](const char* form, const char* shift, const std::string& color) {
    return Settings{{"form", form}, {"shift", shift}, {"base_color", color}, {"roughness", "0.7"}};
  };
  EXPECT_LT(worst_asymmetry(settings("d_eon", "0", blue)), 1e-11);
  EXPECT_LT(worst_asymmetry(settings("unreal_reference", "0", "1")), 1e-11);
  const double inner = worst_asymmetry(settings("unreal_reference", "0", blue));
  const double tilt = worst_asymmetry(settings("d_eon", "0.035", blue));
  const double both = worst_asymmetry(settings("unreal_reference", "0.035", blue));
  std::printf("  |f - f'|/mean over 40 pairs: θt of the light %.3f, tilt %.3f, both %.3f\n", inner, tilt, both);
  EXPECT_GT(inner, 0.01);
  EXPECT_GT(tilt, 0.01);
  EXPECT_GT(both, 0.01);
}

TEST(HairReference, DependsOnAzimuthDifferenceAloneAndIsEven) {
  UniformNumbers uniform(4);
  const std::unique_ptr<const Integrator> integrator = hair().make(fibre({{"base_color", "0.55,0.3,0.12"}}));
  for (int k = 0; k < 20; ++k) {
    const double a = uniform.between(-1.4, 1.4), b = uniform.between(-1.4, 1.4), phi = uniform.between(0.1, 3.0);
    const double truth = integrator->exact(fibre_direction(a, 0.0), fibre_direction(b, phi)).y;
    EXPECT_LT(relative_error(integrator->exact(fibre_direction(a, 1.0), fibre_direction(b, 1.0 + phi)).y, truth), 1e-9);
    EXPECT_LT(relative_error(integrator->exact(fibre_direction(a, 1.0), fibre_direction(b, 1.0 - phi)).y, truth), 1e-9);
  }
}

TEST(HairReference, LobesAddUpAndChannelsAreOneWhereAllAreEqual) {
  const Direction wi = fibre_direction(0.2, 0.0), wo = fibre_direction(-0.1, 2.0);
  double sum = 0.0;
  for (const std::string lobe : {"r", "tt", "trt"}) {
    sum += hair().make(fibre({{"lobes", lobe}, {"base_color", "0.55,0.3,0.12"}}))->exact(wi, wo).y;
  }
  const std::unique_ptr<const Integrator> all = hair().make(fibre({{"base_color", "0.55,0.3,0.12"}}));
  EXPECT_NEAR(all->exact(wi, wo).y, sum, 1e-12 * sum);
  // A grey hair is a coloured one's channel of that value.
  const std::unique_ptr<const Integrator> grey = hair().make(fibre({{"base_color", "0.3"}}));
  EXPECT_NEAR(grey->exact(wi, wo).x, all->exact(wi, wo).y, 1e-11 * sum);
  EXPECT_EQ(grey->channels(), 1);
  EXPECT_EQ(all->channels(), 3);
  EXPECT_EQ(hair().make(fibre({{"base_color", "0.55,0.3,0.12"}, {"lobes", "r"}}))->channels(), 1);
  EXPECT_TRUE(hair().sphere);
}

TEST(HairReference, SeparableFormMovesTheReflectionByTheTiltAndUnrealsByTwice) {
  // Where R peaks over the light's inclination, for a view in the normal plane at φ = 0.
  const auto peak = [&](const char* form) {
    const std::unique_ptr<const Integrator> integrator =
        hair().make(fibre({{"form", form}, {"lobes", "r"}, {"roughness", "0.1"}}));
    double best = 0.0, at = 0.0;
    for (double theta = -0.3; theta < 0.3; theta += 1e-3) {
      const double value = integrator->exact(fibre_direction(theta, 0.0), fibre_direction(0.0, 0.0)).x;
      if (value > best) best = value, at = theta;
    }
    return at;
  };
  EXPECT_NEAR(peak("d_eon"), -0.07, 2e-3);
  EXPECT_NEAR(peak("unreal_reference"), -0.14, 2e-3);
}

TEST(HairReference, MonteCarloIsWithinItsErrorsOfQuadrature) {
  UniformNumbers uniform(2024);
  double chi_squared = 0.0;
  int count = 0;
  while (count < 100) {
    const auto pick = [&](double n) { return std::floor(uniform.between(0.0, n)); };
    ParameterValues values = fibre();
    values.set("roughness", uniform.between(0.45, 1.0));
    values.set("base_color", std::array{uniform(), uniform(), uniform()});
    values.set("ior", uniform.between(1.2, 2.0));
    values.set("lobes", pick(4));
    values.set("form", pick(2));
    values.set("fresnel", pick(2));
    values.set("absorption", pick(2));
    values.set("azimuthal", pick(2));
    const Direction wi = random_direction(uniform), wo = random_direction(uniform);
    const std::unique_ptr<const Integrator> integrator = hair().make(values);
    const double truth = integrator->exact(wi, wo).x;
    constexpr std::uint32_t samples = 4096;
    std::array<double, replicate_count> means;
    for (std::uint32_t r = 0; r < replicate_count; ++r) {
      Rgb value;
      const SamplePoints points(Sampler::philox,
                                {.seed = 9, .entry = static_cast<std::uint64_t>(count), .replicate = r});
      integrator->sample_row(wo, {&wi, 1}, points, samples, false, {.values = {&value, 1}});
      means[r] = value.x;
    }
    const MeanAndError estimate = mean_and_error(std::span<const double>(means));
    // In the detector's far tail the mean of a replicate is not normal.
    if (!(truth > 0.0) || estimate.standard_error > 0.02 * truth) continue;
    const double t = (estimate.mean - truth) / estimate.standard_error;
    const double normal = quantile(boost::math::normal(), cdf(boost::math::students_t(replicate_count - 1), t));
    chi_squared += normal * normal;
    ++count;
  }
  std::printf("  chi² %.1f on 100\n", chi_squared);
  const boost::math::chi_squared distribution(100);
  EXPECT_LT(chi_squared, quantile(complement(distribution, 0.5 * false_alarm)));
  EXPECT_GT(chi_squared, quantile(distribution, 0.5 * false_alarm));
}

TEST(HairReference, SobolRowsOfSharpHairAgreeWithQuadrature) {
  const std::unique_ptr<const Integrator> integrator =
      hair().make(fibre({{"roughness", "0.15"}, {"base_color", "0.55,0.3,0.12"}}));
  const Direction wo = fibre_direction(0.1, 0.0);
  std::vector<Direction> wi;
  for (const double phi : {0.2, 1.0, 1.8, 2.4, 3.1}) wi.push_back(fibre_direction(-0.12, phi));
  std::vector<Rgb> exact(wi.size());
  integrator->exact_row(wo, wi, {.values = exact});
  std::vector<std::array<double, replicate_count>> means(wi.size());
  for (std::uint32_t r = 0; r < replicate_count; ++r) {
    std::vector<Rgb> values(wi.size());
    integrator->sample_row(wo, wi, SamplePoints(Sampler::sobol, {.seed = 3, .entry = 0, .replicate = r}), 1000, false,
                           {.values = values});
    for (std::size_t j = 0; j < wi.size(); ++j) means[j][r] = values[j].y;
  }
  for (std::size_t j = 0; j < wi.size(); ++j) {
    const MeanAndError estimate = mean_and_error(std::span<const double>(means[j]));
    const double t = std::abs(estimate.mean - exact[j].y) / estimate.standard_error;
    EXPECT_LT(t, quantile(complement(boost::math::students_t(replicate_count - 1), 0.5 * false_alarm / 5.0))) << j;
  }
}

TEST(HairReference, IsFiniteWhereverParametersAndDirectionsMayGo) {
  std::vector<Direction> directions;
  for (const double cosine : {1.0, 0.7, 1e-3, 1e-9, 1e-30, 0.0}) {
    const double sine = std::sqrt(1.0 - cosine * cosine);
    directions.push_back({cosine, 0.0, sine});
    directions.push_back({-cosine, 0.0, -sine});
    directions.push_back({0.0, cosine, -sine});
    directions.push_back({-cosine, 1e-17, sine});
  }
  for (const std::vector<double>& corner : corner_parameters(hair().parameters, 6)) {
    ParameterValues values = fibre();
    std::copy(corner.begin(), corner.end(), values.flat().begin());
    const std::unique_ptr<const Integrator> integrator = hair().make(values);
    std::vector<Rgb> row(directions.size());
    for (std::size_t o = 0; o < directions.size(); o += 3) {
      integrator->exact_row(directions[o], directions, {.values = row});
      for (std::size_t j = 0; j < row.size(); ++j) {
        EXPECT_TRUE(std::isfinite(row[j].x) && row[j].x >= 0.0) << row[j].x << " at " << o << ", " << j;
      }
      integrator->sample_row(directions[o], directions, SamplePoints(Sampler::sobol, {}), 16, false, {.values = row});
      for (const Rgb& value : row) EXPECT_TRUE(std::isfinite(value.x) && value.x >= 0.0);
    }
  }
}

TEST(HairReference, BlackHairReflectsAndTransmitsNothing) {
  const Direction wi = fibre_direction(0.2, 0.0), wo = fibre_direction(-0.1, 2.0);
  for (const std::string lobe : {"tt", "trt"}) {
    EXPECT_EQ(hair().make(fibre({{"lobes", lobe}, {"base_color", "0"}}))->exact(wi, wo).x, 0.0);
  }
  EXPECT_GT(hair().make(fibre({{"base_color", "0"}}))->exact(wi, wo).x, 0.0);
}

}  // namespace
}  // namespace lobefit
