// The microfacet-specular reference against closed forms, conservation laws, an independent quadrature and an
// independent walk with explicit heights.
//
// Statistical tests have fixed seeds. Unless stated otherwise, one in a million choices of seeds would fail each
// comparison, estimates being taken as Student's with the replicates' 31 degrees of freedom.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <cmath>
#include <complex>
#include <functional>
#include <string>
#include <vector>

#include "models/microfacet/fresnel.h"
#include "reference/estimate.h"
#include "reference/specular/albedo_table.h"
#include "reference/specular/microfacet_specular.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"

namespace lobefit {
namespace {

constexpr double false_alarm = 1e-6;
constexpr std::array both_distributions{Distribution::ggx, Distribution::beckmann};

const FacetReflectance mirror = FacetReflectance::schlick({1.0, 1.0, 1.0}, {1.0, 1.0, 1.0});
const FacetReflectance glass = FacetReflectance::dielectric(1.5);

Facets isotropic(Distribution distribution, double alpha) { return {distribution, alpha, alpha}; }
std::string name(Distribution distribution) { return distribution == Distribution::ggx ? "ggx" : "beckmann"; }

/// Standard errors that an estimate from replicates may stray.
double allowed_errors() {
  static const double quantile =
      boost::math::quantile(boost::math::complement(boost::math::students_t(replicate_count - 1.0), 0.5 * false_alarm));
  return quantile;
}

/// Mean of value(numbers) with its standard error.
MeanAndError estimate(std::uint32_t samples_per_replicate, std::uint64_t entry,
                      const std::function<double(PathNumbers&)>& value) {
  std::array<double, replicate_count> replicates{};
  for (std::size_t r = 0; r < replicate_count; ++r) {
    const SamplePoints points(Sampler::sobol, {11, entry, static_cast<std::uint32_t>(r)});
    for (std::uint32_t k = 0; k < samples_per_replicate; ++k) {
      PathNumbers numbers(points, k);
      replicates[r] += value(numbers);
    }
    replicates[r] /= samples_per_replicate;
  }
  return mean_and_error(std::span<const double>(replicates));
}

/// That two estimates agree.
void expect_same(const MeanAndError& a, const MeanAndError& b, const std::string& what) {
  EXPECT_NEAR(a.mean, b.mean, allowed_errors() * std::hypot(a.standard_error, b.standard_error) + 1e-12) << what;
}

/// χ² of counts against expectations, cells of fewer than 10 expected pooled.
void expect_counts(const std::vector<double>& counts, const std::vector<double>& expected, const std::string& what) {
  double chi2 = 0.0, pooled_count = 0.0, pooled_expected = 0.0;
  int cells = 0;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (expected[k] < 10.0) {
      pooled_count += counts[k], pooled_expected += expected[k];
      continue;
    }
    chi2 += square(counts[k] - expected[k]) / expected[k];
    ++cells;
  }
  if (pooled_expected >= 10.0) chi2 += square(pooled_count - pooled_expected) / pooled_expected, ++cells;
  ASSERT_GT(cells, 3) << what;
  const boost::math::chi_squared distribution(cells - 1.0);
  EXPECT_LT(chi2, boost::math::quantile(boost::math::complement(distribution, false_alarm)))
      << what << ", " << cells << " cells";
}

/// ∫ over the unit sphere, or one hemisphere, by Gauss-Legendre in cos θ × midpoints in azimuth.
double sphere_integral(int heights, int azimuths, double lowest, const std::function<double(const Direction&)>& f) {
  double sum = 0.0;
  for (const auto& [lower, upper] : {std::pair{lowest, 0.0}, std::pair{0.0, 1.0}}) {
    if (!(upper > lower)) continue;
    for (const QuadraturePoint& height : gauss_legendre(heights, lower, upper)) {
      const double sine = std::sqrt(1.0 - height.x * height.x);
      for (int k = 0; k < azimuths; ++k) {
        const double azimuth = 2.0 * pi * (k + 0.5) / azimuths;
        sum += height.weight * 2.0 * pi / azimuths * f({sine * std::cos(azimuth), sine * std::sin(azimuth), height.x});
      }
    }
  }
  return sum;
}

// ---- Fresnel ----------------------------------------------------------------------------------------------------

TEST(Fresnel, DielectricClosedForms) {
  for (const double n : {0.5, 1.0 / 1.5, 1.0001, 1.3, 1.5, 2.4}) {
    EXPECT_NEAR(DielectricFresnel::evaluate(1.0, n), square((n - 1.0) / (n + 1.0)), 1e-15);
    // Brewster's angle, tan θ = n: the parallel part vanishes.
    const double brewster = 1.0 / std::sqrt(1.0 + n * n);
    EXPECT_NEAR(DielectricFresnel::evaluate(brewster, n), 0.5 * square((n * n - 1.0) / (n * n + 1.0)), 1e-15);
    EXPECT_NEAR(DielectricFresnel::evaluate(0.0, n), 1.0, 1e-15);
  }
  const double critical = std::sqrt(1.0 - 1.0 / 2.25);
  EXPECT_LT(DielectricFresnel::evaluate(critical + 1e-9, 1.0 / 1.5), 1.0);
  for (const double cosine : {0.0, 1e-300, 1e-12, 0.1, critical - 1e-12}) {
    EXPECT_EQ(DielectricFresnel::evaluate(cosine, 1.0 / 1.5), 1.0) << cosine;
  }
}

TEST(Fresnel, DielectricHemisphericalAverages) {
  // Published to four digits: formulas.md section 7; internal = 1 - (1 - external)/n².
  const std::array<std::array<double, 3>, 4> published{
      {{1.3, 0.0611, 0.4445}, {1.4, 0.0768, 0.5290}, {1.5, 0.0918, 0.5963}, {1.6, 0.1063, 0.6509}}};
  for (const auto& [n, external, internal] : published) {
    const auto average = [](double eta, double lower, double upper) {
      double sum = 0.0;
      for (const QuadraturePoint& p : gauss_legendre(200, lower, upper)) {
        sum += p.weight * 2.0 * p.x * DielectricFresnel::evaluate(p.x, eta);
      }
      return sum;
    };
    const double critical = std::sqrt(1.0 - 1.0 / (n * n));
    const double outside = average(n, 0.0, 1.0);
    const double inside = average(1.0 / n, 0.0, critical) + average(1.0 / n, critical, 1.0);
    EXPECT_NEAR(outside, external, 6e-5);
    EXPECT_NEAR(inside, internal, 6e-5);
    EXPECT_NEAR(inside, 1.0 - (1.0 - outside) / (n * n), 1e-5);
  }
}

TEST(Fresnel, ConductorAgainstComplexArithmetic) {
  for (const double eta : {0.05, 0.2, 1.0, 1.5, 4.0}) {
    for (const double k : {1e-3, 0.5, 3.0, 8.0}) {
      for (const double cosine : {1.0, 0.9, 0.5, 0.1, 1e-3}) {
        const std::complex<double> n(eta, k);
        const std::complex<double> g = std::sqrt(n * n - (1.0 - cosine * cosine));
        const double s = std::norm((cosine - g) / (cosine + g));
        const double p = std::norm((n * n * cosine - g) / (n * n * cosine + g));
        // 1e-12: below total reflection's angle with little absorption, a² is a small difference.
        EXPECT_NEAR(ConductorFresnel::evaluate(cosine, eta, k), 0.5 * (s + p), 1e-12)
            << eta << " + i " << k << ", " << cosine;
      }
      EXPECT_NEAR(ConductorFresnel::evaluate(1.0, eta, k), (square(eta - 1.0) + k * k) / (square(eta + 1.0) + k * k),
                  1e-14);
    }
    EXPECT_NEAR(ConductorFresnel::evaluate(0.3, eta, 0.0), DielectricFresnel::evaluate(0.3, eta), 1e-8);
    EXPECT_NEAR(ConductorFresnel::evaluate(0.0, eta, 2.0), 1.0, 1e-15);
  }
}

TEST(Fresnel, SchlickEnds) {
  const Rgb f0{0.04, 0.5, 1.0}, f90{1.0, 0.8, 0.0};
  EXPECT_EQ(SchlickFresnel::evaluate(1.0, f0, f90).y, 0.5);
  EXPECT_EQ(SchlickFresnel::evaluate(0.0, f0, f90).y, 0.8);
  EXPECT_NEAR(SchlickFresnel::evaluate(0.5, f0, f90).x, 0.04 + 0.96 / 32.0, 1e-16);
}

// ---- facets -----------------------------------------------------------------------------------------------------

const std::array some_facets{Facets{Distribution::ggx, 0.3, 0.3}, Facets{Distribution::ggx, 0.3, 0.8},
                             Facets{Distribution::beckmann, 0.5, 0.5}, Facets{Distribution::beckmann, 0.3, 0.8}};

TEST(Facets, DensityAndProjectedArea) {
  for (const Facets& facets : some_facets) {
    EXPECT_NEAR(sphere_integral(200, 400, 0.0, [&](const Direction& m) { return facets.density(m) * m.z; }), 1.0, 1e-9);
    for (const double theta : {0.0, 50.0, 88.0, 95.0, 130.0}) {
      const Direction w = direction(radians(theta), 0.7);
      const double area =
          sphere_integral(300, 1200, 0.0, [&](const Direction& m) { return facets.density(m) * max(dot(m, w), 0.0); });
      // The horizon of w is a kink in this rule's domain, hence the absolute term.
      EXPECT_NEAR(facets.projected_area(w), area, 2e-5 * area + 1e-7) << theta;
      const double smith = theta < 90.0 ? w.z * (1.0 + facets.lambda(w)) : -w.z * facets.lambda(-w);
      EXPECT_NEAR(facets.projected_area(w), smith, 1e-12) << theta;
    }
  }
}

TEST(Facets, VisibleNormalsFollowTheirDensity) {
  constexpr int heights = 8, azimuths = 12;
  constexpr std::uint32_t samples = 1u << 17;
  for (const Facets& facets : some_facets) {
    for (const double theta : {0.0, 40.0, 85.0, 95.0, 130.0, 170.0}) {
      const Direction w = direction(radians(theta), 0.7);
      if (facets.projected_area(w) < 1e-9) continue;  // Beckmann from far below: no facet to see
      std::vector<double> counts(heights * azimuths), expected(heights * azimuths);
      const auto azimuth_of = [](const Direction& m) { return (std::atan2(m.y, m.x) + pi) / (2.0 * pi); };
      const SamplePoints points(Sampler::philox, {5, 0, 0});
      for (std::uint32_t k = 0; k < samples; ++k) {
        const Direction m = facets.sample_visible(w, points(k));
        const int row = std::min(heights - 1, static_cast<int>(m.z * heights));
        const int column = std::min(azimuths - 1, static_cast<int>(azimuth_of(m) * azimuths));
        counts[static_cast<std::size_t>(row * azimuths + column)] += 1.0;
      }
      for (int row = 0; row < heights; ++row) {
        for (int column = 0; column < azimuths; ++column) {
          double sum = 0.0;
          for (const QuadraturePoint& z : gauss_legendre(24, double(row) / heights, double(row + 1) / heights)) {
            const double sine = std::sqrt(1.0 - z.x * z.x);
            for (const QuadraturePoint& turn :
                 gauss_legendre(24, double(column) / azimuths - 0.5, double(column + 1) / azimuths - 0.5)) {
              const Direction m{sine * std::cos(2.0 * pi * turn.x), sine * std::sin(2.0 * pi * turn.x), z.x};
              sum += z.weight * turn.weight * 2.0 * pi * facets.density(m) * max(dot(m, w), 0.0);
            }
          }
          expected[static_cast<std::size_t>(row * azimuths + column)] = samples * sum / facets.projected_area(w);
        }
      }
      expect_counts(counts, expected, name(facets.distribution) + " " + std::to_string(theta));
    }
  }
}

// ---- one bounce -------------------------------------------------------------------------------------------------

TEST(RoughInterface, ReciprocalInOneBounce) {
  for (const InterfaceMasking masking :
       {InterfaceMasking::correlated, InterfaceMasking::separable, InterfaceMasking::none}) {
    for (const Distribution distribution : both_distributions) {
      const RoughInterface dielectric({distribution, 0.3, 0.6}, glass, 1, masking);
      int across = 0;
      for (const auto& [a, b] : random_pairs(300, 3)) {
        const double same = dielectric.evaluate_single(a, b).x;
        EXPECT_NEAR(dielectric.evaluate_single(b, a).x, same, 1e-12 * same);
        const double through = dielectric.evaluate_single(a, -b).x;
        EXPECT_NEAR(dielectric.evaluate_single(-b, a).x * 2.25, through, 1e-11 * through);
        EXPECT_NEAR(dielectric.reverse_factor(a, -b), 2.25, 1e-15);
        if (through > 0.0) ++across;
      }
      EXPECT_GT(across, 30);
    }
  }
}

TEST(RoughInterface, MatchesTheTextbookForm) {
  // Walter et al. 2007, equations 20 and 21, with G2 of the two maskings on one side.
  const Facets facets{Distribution::ggx, 0.4, 0.4};
  const RoughInterface correlated(facets, glass, 1), separable(facets, glass, 1, InterfaceMasking::separable);
  for (const auto& [wi, wo] : random_pairs(100, 9)) {
    const Direction h = normalize(wi + wo);
    const double li = smith_lambda(Distribution::ggx, 0.4, wi), lo = smith_lambda(Distribution::ggx, 0.4, wo);
    const double rest =
        DielectricFresnel::evaluate(dot(wi, h), 1.5) * facet_density(Distribution::ggx, 0.4, h) / (4.0 * wi.z * wo.z);
    EXPECT_NEAR(correlated.evaluate_single(wi, wo).x, rest / (1.0 + li + lo), 1e-12 * rest);
    EXPECT_NEAR(separable.evaluate_single(wi, wo).x, rest / ((1.0 + li) * (1.0 + lo)), 1e-12 * rest);
    const Direction t = -wo;
    const Direction sum = wi + t * 1.5;
    Direction m = normalize(sum);
    if (m.z < 0.0) m = -m;
    const double ci = dot(wi, m), ct = -dot(t, m);
    const double through = separable.evaluate_single(wi, t).x;
    if (!(ci > 0.0 && ct > 0.0)) {
      EXPECT_EQ(through, 0.0);
      continue;
    }
    const double expected = ci * ct / (wi.z * wo.z) * 2.25 * (1.0 - DielectricFresnel::evaluate(ci, 1.5)) *
                            facet_density(Distribution::ggx, 0.4, m) / ((1.0 + li) * (1.0 + lo)) /
                            square(dot(wi, m) + 1.5 * dot(t, m));
    EXPECT_NEAR(through, expected, 1e-11 * expected);
  }
}

TEST(RoughInterface, SamplesOfOneBounceFollowTheirDensity) {
  // Each bin of kept directions against ∫ pdf; and weight = f |cos θ| / pdf sample by sample.
  constexpr int heights = 12, azimuths = 8;
  constexpr std::uint32_t samples = 1u << 16;
  for (const Distribution distribution : both_distributions) {
    for (const double theta : {30.0, 80.0, 125.0}) {
      const RoughInterface interface({distribution, 0.4, 0.7}, glass, 1);
      const Direction from = direction(radians(theta), 0.4);
      const SamplePoints points(Sampler::philox, {6, 0, 0});
      std::vector<double> counts(2 * heights * azimuths), expected(counts.size());
      const auto cell = [&](const Direction& w) {
        const int row = std::min(2 * heights - 1, static_cast<int>((w.z + 1.0) * heights));
        const int column =
            std::min(azimuths - 1, static_cast<int>((std::atan2(w.y, w.x) / (2.0 * pi) + 0.5) * azimuths));
        return static_cast<std::size_t>(row * azimuths + column);
      };
      for (std::uint32_t k = 0; k < samples; ++k) {
        PathNumbers numbers(points, k);
        const InterfaceSample sample = interface.sample(from, numbers);
        if (sample.weight.x == 0.0) continue;
        EXPECT_EQ(sample.reflected, (sample.direction.z > 0.0) == (from.z > 0.0));
        counts[cell(sample.direction)] += 1.0;
        if (k % 64 == 0 && abs(sample.direction.z) > 1e-3) {
          const double weight = interface.evaluate_single(from, sample.direction).x * abs(sample.direction.z) /
                                interface.pdf(from, sample.direction);
          EXPECT_NEAR(sample.weight.x, weight, 1e-8 * weight);
        }
      }
      for (int row = 0; row < 2 * heights; ++row) {
        for (int column = 0; column < azimuths; ++column) {
          double sum = 0.0;
          for (const QuadraturePoint& z :
               gauss_legendre(40, double(row) / heights - 1.0, double(row + 1) / heights - 1.0)) {
            const double sine = std::sqrt(1.0 - z.x * z.x);
            for (const QuadraturePoint& turn :
                 gauss_legendre(40, double(column) / azimuths - 0.5, double(column + 1) / azimuths - 0.5)) {
              sum += z.weight * turn.weight * 2.0 * pi *
                     interface.pdf(from, {sine * std::cos(2.0 * pi * turn.x), sine * std::sin(2.0 * pi * turn.x), z.x});
            }
          }
          expected[static_cast<std::size_t>(row * azimuths + column)] = samples * sum;
        }
      }
      expect_counts(counts, expected, name(distribution) + " " + std::to_string(theta));
    }
  }
}

TEST(RoughInterface, AnisotropyReducesToIsotropyAndTurns) {
  ParameterValues values(describe_parameters<MicrofacetSpecular>(), "microfacet_specular");
  const auto set = [&](double alpha_x, double alpha_y, double orientation) {
    values.set("alpha_x", alpha_x), values.set("alpha_y", alpha_y), values.set("orientation", orientation);
    return MicrofacetSpecularIntegrator(values.flat());
  };
  values.set("alpha", 0.35);
  const auto plain = set(0.0, 0.0, 0.0), equal = set(0.35, 0.35, 25.0), along = set(0.2, 0.7, 0.0),
             swapped = set(0.7, 0.2, 90.0), turned = set(0.2, 0.7, 40.0);
  const auto turn = [](const Direction& w) {
    const double c = std::cos(radians(40.0)), s = std::sin(radians(40.0));
    return Direction{c * w.x - s * w.y, s * w.x + c * w.y, w.z};
  };
  for (const auto& [wi, wo] : random_pairs(100, 21)) {
    const double f = plain.exact(wi, wo).x, g = along.exact(wi, wo).x;
    EXPECT_NEAR(equal.exact(wi, wo).x, f, 1e-12 * f);
    EXPECT_NEAR(swapped.exact(wi, wo).x, g, 1e-11 * g);
    EXPECT_NEAR(turned.exact(turn(wi), turn(wo)).x, g, 1e-11 * g);
  }
}

TEST(RoughInterface, SmoothLimit) {
  for (const double theta : {10.0, 50.0, 120.0, 160.0}) {
    const Direction from = direction(radians(theta), 0.5);
    const double eta = theta < 90.0 ? 1.5 : 1.0 / 1.5, fresnel = DielectricFresnel::evaluate(abs(from.z), eta);
    const RoughInterface smooth({Distribution::ggx, 0.0, 0.0}, glass);
    EXPECT_TRUE(smooth.is_delta());
    EXPECT_EQ(smooth.pdf(from, {0.0, 0.0, 1.0}), 0.0);
    const RoughInterface nearly({Distribution::beckmann, 2e-4, 2e-4}, glass);
    const MeanAndError share = estimate(256, 1, [&](PathNumbers& numbers) {
      const PathNumbers same = numbers;
      const InterfaceSample sample = smooth.sample(from, numbers);
      EXPECT_EQ(sample.weight.x, 1.0);
      if (sample.reflected) {
        EXPECT_NEAR(dot(sample.direction, Direction{-from.x, -from.y, from.z}), 1.0, 1e-14);
      } else {
        EXPECT_NEAR(sample.direction.x * eta, -from.x, 1e-14);
        EXPECT_LT(sample.direction.z * from.z, 0.0);
      }
      PathNumbers again = same;
      const InterfaceSample rough = nearly.sample(from, again);
      if (rough.reflected) {
        EXPECT_NEAR(dot(rough.direction, Direction{-from.x, -from.y, from.z}), 1.0, 1e-5);
      } else {
        EXPECT_NEAR(rough.direction.x * eta, -from.x, 5e-3);
      }
      return sample.reflected ? 1.0 : 0.0;
    });
    EXPECT_NEAR(share.mean, fresnel, allowed_errors() * share.standard_error + 1e-12);
  }
  const RoughInterface gold({Distribution::ggx, 0.0, 0.0},
                            FacetReflectance::conductor({0.2, 0.9, 1.5}, {3.0, 2.4, 1.9}));
  const SamplePoints points(Sampler::sobol, {1, 0, 0});
  PathNumbers numbers(points, 0);
  EXPECT_NEAR(gold.sample(direction(0.5, 0.0), numbers).weight.y, ConductorFresnel::evaluate(std::cos(0.5), 0.9, 2.4),
              1e-14);
  const RoughInterface matched({Distribution::ggx, 0.4, 0.4}, FacetReflectance::dielectric(1.0));
  EXPECT_TRUE(matched.is_delta());
  EXPECT_NEAR(matched.sample(direction(0.5, 0.0), numbers).direction.z, -std::cos(0.5), 1e-15);
}

TEST(RoughInterface, Refusals) {
  EXPECT_THROW(RoughInterface({Distribution::ggx, 0.0, 0.5}, mirror), Error);
  EXPECT_THROW(RoughInterface({Distribution::ggx, 0.5, 0.5}, mirror, 0), Error);
  EXPECT_THROW(RoughInterface({Distribution::ggx, 0.5, 0.5}, mirror, 2, InterfaceMasking::separable), Error);
  EXPECT_THROW(FacetReflectance::dielectric(0.0), Error);
  ParameterValues values(describe_parameters<MicrofacetSpecular>(), "microfacet_specular");
  values.set_text("bounces", "all");
  EXPECT_THROW(MicrofacetSpecularIntegrator(values.flat()).exact({0.0, 0.0, 1.0}, {0.0, 0.0, 1.0}), Error);
  values.set_text("interface", "dielectric");
  values.set("ior", 1.0);
  EXPECT_THROW(MicrofacetSpecularIntegrator{values.flat()}, Error);
}

TEST(RoughInterface, FiniteInHostileDirections) {
  const SamplePoints points(Sampler::sobol, {1, 0, 0});
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {1e-4, 0.03, 1.0}) {
      for (const FacetReflectance& reflectance :
           {glass, FacetReflectance::dielectric(0.3), FacetReflectance::conductor({0.2, 1.0, 5.0}, {3.0, 0.0, 9.0})}) {
        const RoughInterface interface(isotropic(distribution, alpha), reflectance);
        std::uint32_t index = 0;
        for (const auto& [a, b] : hostile_pairs()) {
          for (const auto& [from, to] : {std::pair{a, b}, std::pair{a, -b}, std::pair{-a, b}, std::pair{-a, -b}}) {
            PathNumbers numbers(points, ++index);
            const Rgb f = interface.evaluate(from, to, numbers);
            EXPECT_TRUE(std::isfinite(f.x) && f.x >= 0.0 && std::isfinite(f.z) && f.z >= 0.0)
                << alpha << " " << from.z << " " << to.z << " " << f.x << " " << f.z;
            EXPECT_TRUE(std::isfinite(interface.pdf(from, to)));
            const InterfaceSample sample = interface.sample(from, numbers);
            EXPECT_NEAR(dot(sample.direction, sample.direction), 1.0, 1e-9);
            EXPECT_TRUE(sample.weight.x >= 0.0 && sample.weight.x <= 1.0);
          }
        }
      }
    }
  }
}

// ---- albedos of one bounce --------------------------------------------------------------------------------------

TEST(SingleAlbedo, ClosedFormAtTheNormal) {
  // GGX, α = 1, μ = 1: with x = cos 2θ_m, E = ∫ D(m) cos θ_m G1(x) dm; D is uniform and Λ rational there.
  EXPECT_NEAR(
      reflected_albedo(isotropic(Distribution::ggx, 1.0), InterfaceMasking::correlated, 1.0, [](double) { return 1.0; })
          .value,
      1.0 - std::log(2.0), 1e-9);
}

TEST(SingleAlbedo, AgainstIntegralsOverDirections) {
  // Reflection: an integral over outgoing directions, of the function that renderers evaluate: another variable,
  // another rule. Transmission jumps there, where facets stand upright: it is held to the mean weight of samples
  // instead.
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {0.25, 0.6, 1.0}) {
      for (const double mu : {1.0, 0.6, 0.15}) {
        for (const InterfaceMasking masking :
             {InterfaceMasking::correlated, InterfaceMasking::separable, InterfaceMasking::none}) {
          const Facets facets = isotropic(distribution, alpha);
          const std::string where = name(distribution) + " " + std::to_string(alpha) + " " + std::to_string(mu);
          const Direction from = direction(std::acos(mu), 0.0);
          const RoughInterface white(facets, mirror, 1, masking), window(facets, glass, 1, masking);
          const double up = sphere_integral(
              150, 300, 0.0, [&](const Direction& to) { return to.z * white.evaluate_single(from, to).x; });
          EXPECT_NEAR(reflected_albedo(facets, masking, mu, [](double) { return 1.0; }).value, up, 3e-6 * up) << where;
          if (masking == InterfaceMasking::none) continue;
          for (const bool above : {true, false}) {
            const MeanAndError across = estimate(1u << 9, 50, [&](PathNumbers& numbers) {
              const InterfaceSample sample = window.sample(above ? from : -from, numbers);
              return sample.reflected ? 0.0 : sample.weight.x;
            });
            EXPECT_NEAR(transmitted_albedo(facets, masking, mu, above ? 1.5 : 1.0 / 1.5).value, across.mean,
                        allowed_errors() * across.standard_error + 1e-6)
                << where << " " << above;
          }
        }
      }
    }
  }
}

TEST(SingleAlbedo, FurnaceOfACoatThatLosesEnergy) {
  // A coat n = 1.5 over a white Lambertian base, which forgets directions: R + T T'/(1 - R'), averages from below,
  // against paths through both. At μ = ½ the losses for α = .1 and .3 are known to two digits (formulas.md, section 7).
  const std::array<std::array<double, 2>, 3> known{{{0.1, 0.92}, {0.3, 0.68}, {0.8, 0.0}}};
  for (const auto& [alpha, furnace] : known) {
    const Facets facets = isotropic(Distribution::ggx, alpha);
    const double critical = std::sqrt(1.0 - 1.0 / 2.25);
    const auto reflected = [&](double mu, double eta) {
      return reflected_albedo(
          facets, InterfaceMasking::correlated, mu, [&](double c) { return DielectricFresnel::evaluate(c, eta); },
          eta < 1.0 ? critical : 0.0);
    };
    const auto transmitted = [&](double mu) {
      return transmitted_albedo(facets, InterfaceMasking::correlated, mu, 1.5);
    };
    const double back = average_albedo([&](double mu) { return reflected(mu, 1.0 / 1.5); }, critical).value;
    const double out = average_albedo(transmitted).value / 2.25;
    const double albedo = reflected(0.5, 1.5).value + transmitted(0.5).value * out / (1.0 - back);
    if (furnace > 0.0) {
      EXPECT_NEAR(albedo, furnace, 0.005) << alpha;
    }
    const RoughInterface coat(facets, glass, 1);
    const MeanAndError paths = estimate(1u << 11, 60, [&](PathNumbers& numbers) {
      Direction from = direction(radians(60.0), 0.0);
      double weight = 1.0;
      for (;;) {
        const InterfaceSample sample = coat.sample(from, numbers);
        weight *= sample.weight.x;
        if (weight == 0.0 || sample.direction.z > 0.0) return weight;
        const auto u = numbers.next_pair();
        const double radius = std::sqrt(u[0]), azimuth = 2.0 * pi * u[1];
        from = {radius * std::cos(azimuth), radius * std::sin(azimuth), -std::sqrt(1.0 - u[0])};
      }
    });
    EXPECT_NEAR(paths.mean, albedo, allowed_errors() * paths.standard_error) << alpha;
  }
}

TEST(SingleAlbedo, AveragesKeepReciprocityAndFresnel) {
  // n² of what crosses on the average, from either side; and Fresnel's averages in the smooth limit.
  const Facets facets = isotropic(Distribution::beckmann, 0.4);
  const auto crossing = [&](double eta) {
    return average_albedo([&](double mu) { return transmitted_albedo(facets, InterfaceMasking::correlated, mu, eta); },
                          eta < 1.0 ? std::sqrt(1.0 - eta * eta) : 0.0)
        .value;
  };
  EXPECT_NEAR(crossing(1.5), 2.25 * crossing(1.0 / 1.5), 2e-6);
  const auto outside = average_albedo([&](double mu) {
    return reflected_albedo(isotropic(Distribution::beckmann, 0.002), InterfaceMasking::correlated, mu,
                            [](double c) { return DielectricFresnel::evaluate(c, 1.5); });
  });
  EXPECT_NEAR(outside.value, 0.0918, 6e-5);
}

// ---- all bounces ------------------------------------------------------------------------------------------------

/// What one bounce sends anywhere.
double single_total(const Facets& facets, const FacetReflectance& reflectance, double mu, bool above) {
  const double eta = above ? reflectance.ior() : 1.0 / reflectance.ior();
  const double critical = eta < 1.0 ? std::sqrt(1.0 - eta * eta) : 0.0;
  double sum = reflected_albedo(
                   facets, InterfaceMasking::correlated, mu, [&](double c) { return reflectance(c, eta).x; }, critical)
                   .value;
  if (reflectance.transmits()) sum += transmitted_albedo(facets, InterfaceMasking::correlated, mu, eta).value;
  return sum;
}

struct Furnace {
  FacetReflectance reflectance;
  bool above;
};
const std::array furnaces{Furnace{mirror, true}, Furnace{glass, true}, Furnace{glass, false}};
constexpr std::array furnace_angles{0.0, 60.0, 85.0};
constexpr std::array furnace_alphas{0.1, 0.25, 0.5, 1.0};

TEST(WhiteFurnace, FirstBounceByQuadratureOthersByWalks) {
  // Nothing is absorbed: what one bounce sends out, integrated from the closed forms, and what the walk sends out later
  // are 1 together. Each entry to its own error, and 12 entries together to 1e-3.
  for (const Distribution distribution : both_distributions) {
    for (const Furnace& furnace : furnaces) {
      double mean = 0.0;
      for (const double alpha : furnace_alphas) {
        for (const double theta : furnace_angles) {
          const RoughInterface interface(isotropic(distribution, alpha), furnace.reflectance);
          const Direction from = direction(furnace.above ? radians(theta) : pi - radians(theta), 0.3);
          const MeanAndError further = estimate(1u << 12, 2, [&](PathNumbers& numbers) {
            InterfaceSample result{};
            const bool escaped = interface.walk(from, numbers, result, RoughInterface::Second::forced,
                                                [](const RoughInterface::Vertex&) {});
            return escaped ? result.weight.x : 0.0;
          });
          const double total = further.mean + single_total(interface.facets(), furnace.reflectance,
                                                           std::cos(radians(theta)), furnace.above);
          EXPECT_NEAR(total, 1.0, allowed_errors() * further.standard_error + 1e-6)
              << name(distribution) << " " << alpha << " " << theta;
          EXPECT_LT(further.standard_error, 1.2e-3);
          mean += total / (furnace_alphas.size() * furnace_angles.size());
        }
      }
      EXPECT_NEAR(mean, 1.0, 1e-3) << name(distribution);
    }
  }
}

TEST(WhiteFurnace, ByEvaluation) {
  // The same for evaluate(): E of one bounce, and f of the others over directions from the lobe and the whole sphere.
  double mean = 0.0;
  int count = 0;
  for (const Distribution distribution : both_distributions) {
    for (const Furnace& furnace : furnaces) {
      for (const double alpha : furnace_alphas) {
        for (const double theta : furnace_angles) {
          const RoughInterface interface(isotropic(distribution, alpha), furnace.reflectance);
          const Direction from = direction(furnace.above ? radians(theta) : pi - radians(theta), 0.3);
          const MeanAndError further = estimate(1u << 10, 3, [&](PathNumbers& numbers) {
            const bool lobe = numbers.next() < 0.5;
            const auto uniform = numbers.next_pair();
            const double sine = std::sqrt(1.0 - square(1.0 - 2.0 * uniform[0]));
            const std::optional<Direction> to =
                lobe ? interface.sample_lobe(from, numbers)
                     : std::optional(Direction{sine * std::cos(2.0 * pi * uniform[1]),
                                               sine * std::sin(2.0 * pi * uniform[1]), 1.0 - 2.0 * uniform[0]});
            if (!to) return 0.0;
            const double density = 0.5 * interface.pdf(from, *to) + 0.5 / (4.0 * pi);
            const double f = interface.evaluate(from, *to, numbers).x - interface.evaluate_single(from, *to).x;
            return f * abs(to->z) / density;
          });
          const double total = further.mean + single_total(interface.facets(), furnace.reflectance,
                                                           std::cos(radians(theta)), furnace.above);
          EXPECT_NEAR(total, 1.0, allowed_errors() * further.standard_error + 1e-6)
              << name(distribution) << " " << alpha << " " << theta << " " << furnace.above;
          mean += total;
          ++count;
        }
      }
    }
  }
  EXPECT_NEAR(mean / count, 1.0, 3e-3);
}

TEST(RoughInterface, WalkAndEvaluationAgreeInEveryBin) {
  // Directions of the walk against f of two and more bounces, in 16 heights × 3 azimuths.
  for (const Distribution distribution : both_distributions) {
    for (const double theta : {50.0, 130.0}) {
      const RoughInterface interface({distribution, 0.5, 0.9}, glass);
      const Direction from = direction(radians(theta), 0.4);
      constexpr int heights = 16, azimuths = 3;
      constexpr std::uint32_t samples = 1u << 11;
      std::vector<std::array<double, replicate_count>> walked(heights * azimuths), evaluated(heights * azimuths);
      const auto cell = [&](const Direction& w) {
        const int row = std::min(heights - 1, static_cast<int>((w.z + 1.0) * heights / 2));
        const int column =
            std::min(azimuths - 1, static_cast<int>((std::atan2(w.y, w.x) / (2.0 * pi) + 0.5) * azimuths));
        return static_cast<std::size_t>(row * azimuths + column);
      };
      for (auto* table : {&walked, &evaluated}) {
        for (auto& replicates : *table) replicates.fill(0.0);
      }
      for (std::size_t r = 0; r < replicate_count; ++r) {
        const SamplePoints points(Sampler::philox, {17, 0, static_cast<std::uint32_t>(r)});
        for (std::uint32_t k = 0; k < samples; ++k) {
          PathNumbers numbers(points, k);
          int order = 0;
          InterfaceSample result{};
          interface.walk(from, numbers, result, RoughInterface::Second::by_chance,
                         [&](const RoughInterface::Vertex& vertex) { order = vertex.order; });
          if (order > 1) walked[cell(result.direction)][r] += 1.0 / samples;
          const auto u = numbers.next_pair();
          const double sine = std::sqrt(1.0 - square(1.0 - 2.0 * u[0]));
          const Direction to{sine * std::cos(2.0 * pi * u[1]), sine * std::sin(2.0 * pi * u[1]), 1.0 - 2.0 * u[0]};
          const double f = interface.evaluate(from, to, numbers).x - interface.evaluate_single(from, to).x;
          evaluated[cell(to)][r] += f * abs(to.z) * 4.0 * pi / samples;
        }
      }
      int compared = 0;
      for (std::size_t k = 0; k < walked.size(); ++k) {
        // Where next to no walk ends, its spread is no estimate.
        const MeanAndError mean = mean_and_error(std::span<const double>(walked[k]));
        if (mean.mean * samples * replicate_count < 50.0) continue;
        ++compared;
        expect_same(mean_and_error(std::span<const double>(walked[k])),
                    mean_and_error(std::span<const double>(evaluated[k])), "cell " + std::to_string(k));
      }
      EXPECT_GE(compared, 10);
    }
  }
}

TEST(RoughInterface, ReciprocalInAllBounces) {
  const Direction a = direction(radians(35.0), 0.2), b = direction(radians(70.0), 2.0);
  for (const Distribution distribution : both_distributions) {
    const RoughInterface interface({distribution, 0.4, 0.8}, glass);
    const auto f = [&](const Direction& from, const Direction& to, std::uint64_t entry) {
      return estimate(1u << 11, entry, [&](PathNumbers& numbers) { return interface.evaluate(from, to, numbers).x; });
    };
    expect_same(f(a, b, 31), f(b, a, 32), "above");
    expect_same(f(-a, -b, 33), f(-b, -a, 34), "below");
    MeanAndError back = f(-b, a, 36);
    back.mean *= 2.25, back.standard_error *= 2.25;
    expect_same(f(a, -b, 35), back, "across");
    EXPECT_GT(back.mean, 20.0 * back.standard_error);
  }
}

/// The random walk as the paper writes it: heights uniform on [-1, 1], C1(h) = (h + 1)/2, free paths through C1 and its
/// inverse (Heitz et al. 2016, supplement, section 3), the other side's surface by turning everything over, and normals
/// by rejection or weights. Shares no code with the interface but Fresnel's equations.
class HeightWalk {
 public:
  HeightWalk(Distribution distribution, double alpha, double ior, std::uint64_t seed)
      : distribution_(distribution), alpha_(alpha), ior_(ior), uniform_(seed) {}

  struct Result {
    int order;
    double weight;
    Direction direction;
  };

  Result operator()(const Direction& from) {
    bool outside = from.z > 0.0;
    Direction ray = -from;
    double height = outside ? 1.0 : -1.0, weight = 1.0;
    for (int order = 0;; ++order) {
      const double next = outside ? next_height(ray, height) : -next_height(-ray, -height);
      if (!(std::abs(next) <= 1.0)) return {order, weight, ray};
      height = next;
      const Direction back = outside ? -ray : ray;
      const Direction normal = visible_normal(back, weight);
      const double eta = outside ? ior_ : 1.0 / ior_, cosine = dot(back, normal);
      if (uniform_() < (ior_ > 0.0 ? DielectricFresnel::evaluate(cosine, eta) : 1.0)) {
        const Direction reflected = normal * (2.0 * cosine) - back;
        ray = outside ? reflected : -reflected;
      } else {
        // Snell's law by components: the tangential part shrinks by η.
        const Direction tangential = (normal * cosine - back) / eta;
        const Direction refracted = tangential - normal * std::sqrt(1.0 - dot(tangential, tangential));
        ray = outside ? refracted : -refracted;
        outside = !outside;
      }
    }
  }

 private:
  double lambda(const Direction& w) const {
    const double a = w.z / (alpha_ * std::hypot(w.x, w.y));  // of either sign
    if (distribution_ == Distribution::ggx) return 0.5 * (-1.0 + std::copysign(std::sqrt(1.0 + 1.0 / (a * a)), a));
    return 0.5 * (std::erf(a) - 1.0) + std::exp(-a * a) / (2.0 * a * std::sqrt(pi));
  }
  double next_height(const Direction& ray, double height) {
    const double u = uniform_(), c1 = std::clamp(0.5 * (height + 1.0), 0.0, 1.0), exponent = lambda(ray);
    if (ray.z > 0.0 && u >= 1.0 - std::pow(c1, exponent)) return 2.0;
    return 2.0 * c1 * std::pow(1.0 - u, -1.0 / exponent) - 1.0;
  }
  Direction visible_normal(const Direction& w, double& weight) {
    if (distribution_ == Distribution::beckmann) {
      // A facet of the whole surface, weighted by what it shows: (w·m)⁺ / (m.z σ(w)).
      const double radius = alpha_ * std::sqrt(-std::log(1.0 - uniform_())), azimuth = 2.0 * pi * uniform_();
      const Direction slope{radius * std::cos(azimuth), radius * std::sin(azimuth), 1.0};
      const double sigma = w.z * (1.0 + lambda(w));
      weight *= max(dot(w, slope), 0.0) / sigma;
      return normalize(slope);
    }
    // The unit-roughness surface is a hemisphere: points of its silhouette's disk that hit its upper half.
    const Direction s = normalize(Direction{alpha_ * w.x, alpha_ * w.y, w.z});
    const Direction t1 = normalize(cross(s, std::abs(s.z) < 0.9 ? Direction{0.0, 0.0, 1.0} : Direction{1.0, 0.0, 0.0}));
    const Direction t2 = cross(s, t1);
    for (;;) {
      const double x = uniform_.between(-1.0, 1.0), y = uniform_.between(-1.0, 1.0);
      if (x * x + y * y > 1.0) continue;
      const Direction m = t1 * x + t2 * y + s * std::sqrt(1.0 - x * x - y * y);
      if (m.z > 0.0) return normalize(Direction{alpha_ * m.x, alpha_ * m.y, m.z});
    }
  }

  Distribution distribution_;
  double alpha_, ior_;
  UniformNumbers uniform_;
};

TEST(RoughInterface, WalkAgainstExplicitHeights) {
  // Orders 1 to 4 and the rest × 8 heights of the direction of escape.
  constexpr int orders = 5, heights = 8;
  constexpr std::uint32_t samples = 1u << 13;
  for (const Distribution distribution : both_distributions) {
    for (const double ior : {0.0, 1.5}) {
      for (const double theta : {20.0, 75.0, 115.0}) {
        if (ior == 0.0 && theta > 90.0) continue;
        const double alpha = distribution == Distribution::ggx ? 0.6 : 0.9;
        const RoughInterface interface(isotropic(distribution, alpha), ior > 0.0 ? glass : mirror);
        const Direction from = direction(radians(theta), 0.0);
        std::vector<std::array<double, replicate_count>> ours(orders * heights), theirs(orders * heights);
        for (auto* table : {&ours, &theirs}) {
          for (auto& replicates : *table) replicates.fill(0.0);
        }
        const auto cell = [&](int order, const Direction& w) {
          const int row = std::min(heights - 1, static_cast<int>((w.z + 1.0) * heights / 2));
          return static_cast<std::size_t>(std::min(order, orders) - 1) * heights + static_cast<std::size_t>(row);
        };
        for (std::size_t r = 0; r < replicate_count; ++r) {
          HeightWalk independent(distribution, alpha, ior, 1000 + r);
          const SamplePoints points(Sampler::philox, {23, 0, static_cast<std::uint32_t>(r)});
          for (std::uint32_t k = 0; k < samples; ++k) {
            PathNumbers numbers(points, k);
            int order = 0;
            InterfaceSample result{};
            interface.walk(from, numbers, result, RoughInterface::Second::by_chance,
                           [&](const RoughInterface::Vertex& vertex) { order = vertex.order; });
            ours[cell(order, result.direction)][r] += 1.0 / samples;
            const HeightWalk::Result other = independent(from);
            theirs[cell(other.order, other.direction)][r] += other.weight / samples;
          }
        }
        for (std::size_t k = 0; k < ours.size(); ++k) {
          expect_same(mean_and_error(std::span<const double>(ours[k])),
                      mean_and_error(std::span<const double>(theirs[k])),
                      name(distribution) + " n " + std::to_string(ior) + " " + std::to_string(theta) + " cell " +
                          std::to_string(k));
        }
      }
    }
  }
}

// ---- the reference and the table --------------------------------------------------------------------------------

TEST(MicrofacetSpecular, RowsAgreeWithTheInterface) {
  ParameterValues values(describe_parameters<MicrofacetSpecular>(), "microfacet_specular");
  values.set_text("interface", "dielectric");
  values.set_text("bounces", "all");
  values.set("alpha", 0.7);
  const MicrofacetSpecularIntegrator integrator(values.flat());
  EXPECT_EQ(integrator.channels(), 1);
  const Direction above = direction(radians(40.0), 0.0), below = -direction(radians(25.0), 0.8);
  const std::array lights{direction(radians(30.0), 2.0), direction(radians(75.0), 0.5), -direction(radians(50.0), 1.0)};
  for (const Direction& wo : {above, below}) {
    std::array<std::array<double, replicate_count>, lights.size()> rows{};
    for (std::size_t r = 0; r < replicate_count; ++r) {
      std::array<Rgb, lights.size()> f;
      std::vector<double> orders(static_cast<std::size_t>(integrator.orders()) * lights.size());
      integrator.sample_row(wo, lights, SamplePoints(Sampler::sobol, {3, 0, static_cast<std::uint32_t>(r)}), 1024,
                            false, {.values = f, .orders = orders});
      for (std::size_t j = 0; j < lights.size(); ++j) {
        rows[j][r] = f[j].x;
        double sum = 0.0;
        for (std::size_t at = j; at < orders.size(); at += lights.size()) sum += orders[at];
        EXPECT_NEAR(sum, f[j].x, 1e-3 * f[j].x);  // but for order 17 on
        EXPECT_LE(sum, f[j].x * (1.0 + 1e-12));
      }
    }
    for (std::size_t j = 0; j < lights.size(); ++j) {
      const MeanAndError direct = estimate(
          1024, 40, [&](PathNumbers& numbers) { return integrator.interface().evaluate(lights[j], wo, numbers).x; });
      expect_same(mean_and_error(std::span<const double>(rows[j])), direct, std::to_string(j));
    }
  }
}

TEST(MicrofacetSpecular, OrdersGiveEveryConstantReflectance) {
  ParameterValues values(describe_parameters<MicrofacetSpecular>(), "microfacet_specular");
  values.set_text("bounces", "all");
  values.set("f0", std::array{1.0, 0.5, 0.1});
  values.set("f90", std::array{1.0, 0.5, 0.1});
  const MicrofacetSpecularIntegrator integrator(values.flat());
  EXPECT_EQ(integrator.channels(), 3);
  const std::array lights{direction(radians(30.0), 2.0), direction(radians(75.0), 0.5)};
  std::array<Rgb, lights.size()> f;
  std::vector<double> orders(16 * lights.size());
  integrator.sample_row(direction(radians(50.0), 0.0), lights, SamplePoints(Sampler::sobol, {3, 0, 0}), 4096, false,
                        {.values = f, .orders = orders});
  for (std::size_t j = 0; j < lights.size(); ++j) {
    double half = 0.0, tenth = 0.0;
    for (int n = 1; n <= 16; ++n) {
      const double order = orders[static_cast<std::size_t>(n - 1) * lights.size() + j];
      half += order * std::pow(0.5, n), tenth += order * std::pow(0.1, n);
    }
    EXPECT_NEAR(half, f[j].y, 1e-5 * half);
    EXPECT_NEAR(tenth, f[j].z, 1e-12 * tenth);
  }
}

TEST(MicrofacetSpecular, Registered) {
  const Reference reference = microfacet_specular_reference();
  EXPECT_EQ(reference.name, "microfacet_specular");
  EXPECT_TRUE(reference.sphere);
  const auto integrator = reference.make(reference.defaults());
  const Direction wi = direction(0.3, 0.0), wo = direction(0.8, 2.5);
  EXPECT_NEAR(integrator->exact(wi, wo).x,
              RoughInterface(isotropic(Distribution::ggx, 0.5), mirror, 1).evaluate_single(wi, wo).x, 1e-12);
}

TEST(AlbedoTable, SplitAverageAndJson) {
  AlbedoTableOptions options;
  options.mu = {0.2, 1.0}, options.alpha = {0.5, 1.0};
  Monitor monitor;
  const AlbedoTable table = make_albedo_table(options, monitor);
  const AlbedoColumn &e = table.column("albedo"), &a = table.column("f0_weight"), &b = table.column("f90_weight");
  EXPECT_NEAR(e.value[3], 1.0 - std::log(2.0), 1e-8);
  const Facets facets = isotropic(Distribution::ggx, 0.5);
  const double silver = reflected_albedo(facets, InterfaceMasking::correlated, 0.2, [](double c) {
                          return SchlickFresnel::evaluate(c, 0.7, 0.9);
                        }).value;
  EXPECT_NEAR(0.7 * a.value[0] + 0.9 * b.value[0], silver, 1e-7);
  double average = 0.0;
  for (const QuadraturePoint& p : gauss_legendre(40, 0.0, 1.0)) {
    average += p.weight * 2.0 * p.x *
               reflected_albedo(facets, InterfaceMasking::correlated, p.x, [](double) { return 1.0; }).value;
  }
  EXPECT_NEAR(e.average[0], average, 1e-6);
  for (const AlbedoColumn& column : table.columns) {
    for (const double error : column.error) EXPECT_LT(error, 1e-6);
    for (const double error : column.average_error) EXPECT_LT(error, 1e-5);
  }
  const Json json = table.json(Json::object(), "command");
  EXPECT_EQ(json["columns"]["albedo"]["values"].size(), 2u);
  EXPECT_EQ(json["columns"]["albedo"]["values"][1][1].get<double>(), e.value[3]);
  EXPECT_EQ(json["provenance"]["method"], "quadrature");
  options.alpha = {1.5};
  EXPECT_THROW(make_albedo_table(options, monitor), Error);
}

TEST(AlbedoTable, DielectricOfAllBouncesIsLossless) {
  AlbedoTableOptions options;
  options.reflectance = glass, options.bounces = RoughInterface::all_bounces, options.samples = 1u << 16;
  options.mu = {0.3, 0.9}, options.alpha = {0.4};
  Monitor monitor;
  const auto make = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return make_albedo_table(options, monitor);
  };
  const AlbedoTable table = make(1), again = make(2);
  for (std::size_t k = 0; k < table.columns.size(); ++k) {
    EXPECT_EQ(table.columns[k].value, again.columns[k].value);
    EXPECT_EQ(table.columns[k].average, again.columns[k].average);
  }
  for (const std::string side : {"above", "below"}) {
    const AlbedoColumn &r = table.column("reflected_" + side), &t = table.column("transmitted_" + side);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_NEAR(r.value[k] + t.value[k], 1.0, allowed_errors() * (r.error[k] + t.error[k]));
      EXPECT_LT(r.error[k] + t.error[k], 2e-3);
    }
    EXPECT_NEAR(r.average[0] + t.average[0], 1.0, allowed_errors() * (r.average_error[0] + t.average_error[0]));
  }
  const AlbedoColumn &out = table.column("transmitted_below"), &in = table.column("transmitted_above");
  EXPECT_NEAR(in.average[0], 2.25 * out.average[0],
              allowed_errors() * std::hypot(in.average_error[0], 2.25 * out.average_error[0]));
}

}  // namespace
}  // namespace lobefit
