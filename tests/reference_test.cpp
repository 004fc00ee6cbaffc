// The microfacet-diffuse reference against published values, closed forms, conservation laws and an independent
// quadrature; its Monte Carlo estimates against itself.
//
// The independent quadrature knows nothing of visible arcs: it integrates over the plane of facet slopes, turned so
// that the light's horizon is a line of constant first slope.
//
// Statistical tests have fixed seeds. Unless stated otherwise, one in a million choices of seeds would fail them.
#include <gtest/gtest.h>

#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "reference/diffuse/facet_quadrature.h"
#include "reference/diffuse/microfacet_diffuse.h"
#include "reference/references.h"
#include "reference/visible_normals.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"

namespace lobefit {
namespace {

constexpr double false_alarm = 1e-6;
constexpr std::array both_distributions{Distribution::ggx, Distribution::beckmann};

const Reference& microfacet_diffuse() { return find_reference("microfacet_diffuse"); }

ParameterValues surface(double alpha, std::string_view masking = "correlated",
                        Distribution distribution = Distribution::ggx) {
  ParameterValues values = microfacet_diffuse().defaults();
  values.set("alpha", alpha);
  values.set_text("masking", masking);
  values.set_text("distribution", distribution == Distribution::ggx ? "ggx" : "beckmann");
  return values;
}

double exact(const ParameterValues& values, const Direction& wi, const Direction& wo) {
  return microfacet_diffuse().make(values)->exact(wi, wo).x;
}

Direction from_degrees(double theta, double phi) { return direction(radians(theta), radians(phi)); }

std::string place(Distribution distribution, double alpha, const Direction& wi, const Direction& wo) {
  const auto text = [](const Direction& w) {
    return "(" + number_text(w.x) + ", " + number_text(w.y) + ", " + number_text(w.z) + ")";
  };
  return std::string(distribution == Distribution::ggx ? "ggx" : "beckmann") + ", alpha " + number_text(alpha) +
         ", wi " + text(wi) + ", wo " + text(wo);
}

// ---- independent truth ------------------------------------------------------------------------------------------

/// Smith's Λ as formulas.md prints it.
double printed_lambda(Distribution distribution, double alpha, const Direction& w) {
  const double tangent = std::hypot(w.x, w.y) / w.z;
  if (distribution == Distribution::ggx) return 0.5 * (-1.0 + std::sqrt(1.0 + alpha * alpha * tangent * tangent));
  if (tangent == 0.0) return 0.0;
  const double a = 1.0 / (alpha * tangent);
  return 0.5 * (std::exp(-a * a) / (a * std::sqrt(pi)) - std::erfc(a));
}

/// Density of facet slopes.
double slope_density(Distribution distribution, double alpha, double squared_slope) {
  const double a2 = alpha * alpha;
  if (distribution == Distribution::ggx) return a2 / (pi * (a2 + squared_slope) * (a2 + squared_slope));
  return std::exp(-squared_slope / a2) / (pi * a2);
}

/// Quadrature on [lower, upper] with panels that shrink by 4 towards both ends, where integrands bend.
class GradedRule {
 public:
  GradedRule(int panels, int points) : unit_(gauss_legendre(points, 0.0, 1.0)) {
    double edge = 0.5;
    for (int k = 0; k < panels; ++k, edge *= 0.25) edges_.push_back(edge);
    edges_.push_back(0.0);
  }

  template <class F>
  double operator()(double lower, double upper, F&& f) const {
    const double length = upper - lower;
    if (!(length > 0.0)) return 0.0;
    double sum = 0.0;
    for (std::size_t panel = 0; panel + 1 < edges_.size(); ++panel) {
      const double width = length * (edges_[panel] - edges_[panel + 1]);
      for (const auto& [x, weight] : unit_) {
        const double offset = length * edges_[panel + 1] + width * x;
        sum += width * weight * (f(lower + offset) + f(upper - offset));
      }
    }
    return sum;
  }

 private:
  std::vector<QuadraturePoint> unit_;
  std::vector<double> edges_;
};

/// ∫ (m·wi)⁺ (m·wo)⁺ D dm over the plane of slopes (p, q), m ∝ (-p, -q, 1), with wi in the plane q = 0.
double independent_kernel(Distribution distribution, double alpha, const Direction& wi, const Direction& wo) {
  const bool ggx = distribution == Distribution::ggx;
  static const GradedRule ggx_rule(9, 14), beckmann_rule(7, 22);
  const GradedRule& rule = ggx ? ggx_rule : beckmann_rule;
  const double sine_i = std::hypot(wi.x, wi.y);
  const double along = sine_i > 0.0 ? (wi.x * wo.x + wi.y * wo.y) / sine_i : wo.x;
  const double across = sine_i > 0.0 ? std::abs(wi.x * wo.y - wi.y * wo.x) / sine_i : std::abs(wo.y);

  // Slopes are scale × tan(u) for GGX, which brings its far slopes near, and scale × u for Beckmann, whose density
  // beyond 6.5 is below 1e-18.
  const double edge = ggx ? pi / 2.0 : 6.5;
  const auto to_unit = [&](double slope, double scale) {
    return ggx ? std::atan2(slope, scale) : std::clamp(slope / scale, -edge, edge);
  };
  const auto to_slope = [&](double u, double scale) { return scale * (ggx ? std::tan(u) : u); };
  const auto stretch = [&](double u, double scale) { return ggx ? scale / (std::cos(u) * std::cos(u)) : scale; };

  // wi sees p < cos/sin; for each p, wo sees q up to a line.
  const double end = sine_i > 0.0 ? to_unit(wi.z / sine_i, alpha) : edge;
  std::vector<double> breaks{-edge, end};
  const auto break_at = [&](double p) {
    const double u = to_unit(p, alpha);
    if (u > -edge && u < end) breaks.push_back(u);
  };
  if (along != 0.0) break_at(wo.z / along);  // where a steep line passes
  if (!ggx && along != 0.0) {                // where the line leaves the range of slopes
    break_at((wo.z - edge * alpha * across) / along);
    break_at((wo.z + edge * alpha * across) / along);
  }
  std::sort(breaks.begin(), breaks.end());

  double sum = 0.0;
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    sum += rule(breaks[i], breaks[i + 1], [&](double u) {
      const double p = to_slope(u, alpha);
      const double scale = ggx ? std::hypot(alpha, p) : alpha;
      const double room = wo.z - p * along;
      const double last = across > 0.0 ? to_unit(room / across, scale) : (room > 0.0 ? edge : -edge);
      return stretch(u, alpha) * rule(-edge, last, [&](double v) {
               const double q = to_slope(v, scale);
               const double squared = p * p + q * q;
               return stretch(v, scale) * slope_density(distribution, alpha, squared) / std::sqrt(1.0 + squared) *
                      std::max(wi.z - p * sine_i, 0.0) * std::max(room - q * across, 0.0);
             });
    });
  }
  return sum;
}

/// f per unit albedo under the masking of that name, from the independent kernel.
double independent_brdf(Distribution distribution, double alpha, std::string_view masking, const Direction& wi,
                        const Direction& wo) {
  const double lambda_i = printed_lambda(distribution, alpha, wi), lambda_o = printed_lambda(distribution, alpha, wo);
  if (masking == "area_mean") return independent_kernel(distribution, alpha, wi, {0.0, 0.0, 1.0}) / (pi * wi.z);
  double g2 = 1.0;
  if (masking == "correlated") g2 = 1.0 / (1.0 + lambda_i + lambda_o);
  if (masking == "separable") g2 = 1.0 / ((1.0 + lambda_i) * (1.0 + lambda_o));
  if (masking == "view_only") g2 = 1.0 / (1.0 + lambda_o);
  return g2 * independent_kernel(distribution, alpha, wi, wo) / (pi * wi.z * wo.z);
}

/// ∫ D cos²θ dm of GGX: what every masking but the view's own gives at normal incidence and view, times π.
double normal_incidence(double alpha) {
  if (alpha == 1.0) return 2.0 / 3.0;
  const double k = std::sqrt((1.0 - alpha) * (1.0 + alpha));
  return (1.0 - alpha * alpha * std::atanh(k) / k) / (k * k);
}

// ---- the distributions ------------------------------------------------------------------------------------------

TEST(Distributions, FacetsProjectToTheSurface) {
  // ∫ D cosθ dm = 1, in x = atan(tanθ / α), which resolves both the peak and the tail.
  static const GradedRule rule(12, 24);
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {0.001, 0.05, 0.5, 1.0}) {
      const double sum = rule(0.0, pi / 2.0, [&](double x) {
        const double slope = alpha * std::tan(x), cosine = 1.0 / std::sqrt(1.0 + slope * slope);
        const Direction m{slope * cosine, 0.0, cosine};
        const double radians_per_x = cosine * cosine * alpha / (std::cos(x) * std::cos(x));
        return 2.0 * pi * m.x * facet_density(distribution, alpha, m) * cosine * radians_per_x;
      });
      EXPECT_NEAR(sum, 1.0, 1e-12) << place(distribution, alpha, {}, {});
    }
  }
}

TEST(Distributions, VisibleAreaIsTheProjectedArea) {
  // Smith's G1 is defined by ∫ G1(w) (w·m)⁺ D dm = cosθ (Heitz 2014, equation 26). For w = (sin, 0, cos) the integral
  // over slopes q across w leaves the marginal of p.
  static const GradedRule rule(12, 20);
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {0.01, 0.1, 0.5, 1.0}) {
      for (const double theta : {0.0, 10.0, 45.0, 80.0, 89.0, 89.99}) {
        const Direction w = from_degrees(theta, 0.0);
        const double edge = distribution == Distribution::ggx ? pi / 2.0 : std::atan(7.0);
        const double last = w.x > 0.0 ? std::min(edge, std::atan2(w.z, alpha * w.x)) : edge;
        const double area = rule(-edge, last, [&](double u) {
          const double p = alpha * std::tan(u), cosine = std::cos(u);
          const double marginal = distribution == Distribution::ggx
                                      ? alpha * alpha / (2.0 * std::pow(alpha * alpha + p * p, 1.5))
                                      : std::exp(-p * p / (alpha * alpha)) / (alpha * std::sqrt(pi));
          return (w.z - p * w.x) * marginal * alpha / (cosine * cosine);
        });
        EXPECT_NEAR(area / (1.0 + smith_lambda(distribution, alpha, w)) / w.z, 1.0, 1e-11)
            << place(distribution, alpha, w, {});
      }
    }
  }
}

// ---- the exact reference ----------------------------------------------------------------------------------------

TEST(MicrofacetDiffuse, MeetsPublishedValues) {
  // formulas.md §3, to the twelve digits printed there.
  const Direction wo = from_degrees(60.0, 0.0);
  EXPECT_NEAR(exact(surface(0.5), from_degrees(60.0, 0.0), wo), 0.361554992058, 5.1e-13);
  EXPECT_NEAR(exact(surface(0.5), from_degrees(60.0, 180.0), wo), 0.127865601469, 5.1e-13);
  const Direction normal{0.0, 0.0, 1.0};
  EXPECT_NEAR(pi * exact(surface(0.5), normal, normal), 0.826436002466, 5.1e-13);
}

TEST(MicrofacetDiffuse, MeetsItsClosedFormAtNormalIncidence) {
  const Direction normal{0.0, 0.0, 1.0};
  for (const double alpha : {0.001, 0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.999, 1.0}) {
    // The closed form itself loses digits as k → 0.
    const double tolerance = alpha == 0.999 ? 1e-11 : 1e-12;
    for (const std::string_view masking : MicrofacetDiffuse::maskings) {
      EXPECT_NEAR(pi * exact(surface(alpha, masking), normal, normal), normal_incidence(alpha), tolerance)
          << masking << ", alpha " << alpha;
    }
  }
}

TEST(MicrofacetDiffuse, MeetsItsLimitWithoutShadowing) {
  // On V = N at α = 1, f μi π tends to 2/(3π) as the light sinks to the horizon.
  for (const double cosine : {1e-6, 1e-9, 1e-12}) {
    const Direction wi{std::sqrt((1.0 - cosine) * (1.0 + cosine)), 0.0, cosine};
    EXPECT_NEAR(exact(surface(1.0, "none"), wi, {0.0, 0.0, 1.0}) * cosine * pi, 2.0 / (3.0 * pi), 1e-10 + cosine);
  }
}

TEST(MicrofacetDiffuse, ViewsFromTheNormalAreNotMasked) {
  // G1(n) = 1: view_only, none and the area mean are one there, and correlated and separable differ from them by
  // G1(wi).
  const Direction normal{0.0, 0.0, 1.0};
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {0.02, 0.3, 1.0}) {
      for (const double theta : {0.0, 40.0, 75.0, 89.0}) {
        const Direction wi = from_degrees(theta, 33.0);
        const double mean = exact(surface(alpha, "area_mean", distribution), wi, normal);
        const double g1 = 1.0 / (1.0 + printed_lambda(distribution, alpha, wi));
        const auto ratio = [&](std::string_view masking) {
          return exact(surface(alpha, masking, distribution), wi, normal) / mean;
        };
        EXPECT_NEAR(ratio("view_only"), 1.0, 1e-12);
        EXPECT_NEAR(ratio("none"), 1.0, 1e-12);
        EXPECT_NEAR(ratio("correlated"), g1, 1e-11);
        EXPECT_NEAR(ratio("separable"), g1, 1e-11);
        // The area mean does not know where the view is.
        EXPECT_EQ(exact(surface(alpha, "area_mean", distribution), wi, from_degrees(70.0, 10.0)), mean);
      }
    }
  }
}

TEST(MicrofacetDiffuse, SmoothSurfacesAreLambertian) {
  for (const Distribution distribution : both_distributions) {
    for (const std::string_view masking : MicrofacetDiffuse::maskings) {
      const double f = exact(surface(0.001, masking, distribution), from_degrees(50.0, 130.0), from_degrees(65.0, 0.0));
      EXPECT_NEAR(f * pi, 1.0, 1e-4) << masking;
    }
  }
}

TEST(MicrofacetDiffuse, MeetsAnIndependentQuadratureOnHostileDirections) {
  double worst = 0.0;
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {0.01, 0.1, 0.5, 1.0}) {
      for (const double theta_i : {0.0, 45.0, 85.0, 89.9, 89.999}) {
        for (const double theta_o : {0.0, 60.0, 89.0, 89.999}) {
          for (const double phi : {0.0, 1.0, 90.0, 179.0, 180.0}) {
            const Direction wi = from_degrees(theta_i, phi), wo = from_degrees(theta_o, 0.0);
            const double truth = independent_brdf(distribution, alpha, "correlated", wi, wo);
            const double error = std::abs(exact(surface(alpha, "correlated", distribution), wi, wo) / truth - 1.0);
            worst = std::max(worst, error);
            EXPECT_LT(error, 1e-9) << place(distribution, alpha, wi, wo);
          }
        }
      }
    }
  }
  RecordProperty("worst_relative_error", number_text(worst));
}

TEST(MicrofacetDiffuse, MeetsAnIndependentQuadratureOnRandomDirections) {
  double worst = 0.0;
  UniformNumbers uniform(21);
  std::size_t index = 0;
  for (const auto& [wi, wo] : random_pairs(200, 20)) {
    const Distribution distribution = both_distributions[index % 2];
    const std::string_view masking = MicrofacetDiffuse::maskings[index++ % MicrofacetDiffuse::maskings.size()];
    const double alpha = std::pow(10.0, uniform.between(-2.0, 0.0));
    const double f = exact(surface(alpha, masking, distribution), wi, wo);
    const double error = std::abs(f / independent_brdf(distribution, alpha, masking, wi, wo) - 1.0);
    worst = std::max(worst, error);
    EXPECT_LT(error, 1e-9) << masking << ", " << place(distribution, alpha, wi, wo);
  }
  RecordProperty("worst_relative_error", number_text(worst));
}

TEST(MicrofacetDiffuse, IsReciprocalAndIsotropic) {
  double worst = 0.0;
  UniformNumbers uniform(23);
  std::size_t index = 0;
  const auto turned = [](const Direction& w, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return Direction{c * w.x - s * w.y, s * w.x + c * w.y, w.z};
  };
  for (const auto& [wi, wo] : random_pairs(200, 22)) {
    const Distribution distribution = both_distributions[index++ % 2];
    const double alpha = std::pow(10.0, uniform.between(-2.0, 0.0)), angle = uniform.between(0.0, 2.0 * pi);
    for (const std::string_view masking : MicrofacetDiffuse::maskings) {
      const ParameterValues values = surface(alpha, masking, distribution);
      const double f = exact(values, wi, wo);
      const bool reciprocal = masking != "view_only" && masking != "area_mean";
      const double swapped = exact(values, wo, wi) / f - 1.0;
      const double rotated = exact(values, turned(wi, angle), turned(wo, angle)) / f - 1.0;
      const double mirrored = exact(values, {wi.x, -wi.y, wi.z}, {wo.x, -wo.y, wo.z}) / f - 1.0;
      for (const double error : {reciprocal ? swapped : 0.0, rotated, mirrored}) {
        worst = std::max(worst, std::abs(error));
        EXPECT_LT(std::abs(error), 1e-9) << masking << ", " << place(distribution, alpha, wi, wo);
      }
    }
  }
  RecordProperty("worst_relative_error", number_text(worst));
}

/// ∫ f μi dwi with the view fixed. `lights` and `azimuths` are the orders of the rule.
double directional_albedo(const ParameterValues& values, const Direction& wo, int lights, int azimuths) {
  double sum = 0.0;
  for (const auto& [theta, weight] : gauss_legendre(lights, 0.0, pi / 2.0)) {
    for (const auto& [phi, phi_weight] : gauss_legendre(azimuths, 0.0, pi)) {
      const Direction wi = direction(theta, phi);
      sum += 2.0 * weight * phi_weight * std::sin(theta) * wi.z * exact(values, wi, wo);
    }
  }
  return sum;
}

TEST(MicrofacetDiffuse, MeetsPublishedDirectionalAlbedos) {
  struct Row {
    double alpha;
    std::array<double, 3> albedos;  // at 0, 60 and 85 degrees
  };
  // formulas.md §3: one bounce, five digits.
  constexpr Row rows[] = {
      {0.25, {0.90612, 0.89476, 0.86236}}, {0.5, {0.78045, 0.75584, 0.75109}}, {1.0, {0.58192, 0.56504, 0.62972}}};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Direction wo = from_degrees(std::array{0.0, 60.0, 85.0}[i], 0.0);
      EXPECT_NEAR(directional_albedo(surface(row.alpha), wo, 28, 20), row.albedos[i], 5.5e-6)
          << "alpha " << row.alpha << ", theta " << degrees(std::acos(wo.z));
    }
  }
}

TEST(MicrofacetDiffuse, UnshadowedFacetsKeepTheirEnergy) {
  // A Lambertian facet sends (1 + cosθ_m)/2 of its light above the horizon. Seen from the normal, facets are visible in
  // proportion to D cosθ_m, so that the albedo of view_only is (1 + ∫ D cos²θ_m dm)/2.
  for (const double alpha : {0.1, 0.5, 1.0}) {
    const ParameterValues values = surface(alpha, "view_only");
    double albedo = 0.0;
    for (const auto& [theta, weight] : gauss_legendre(40, 0.0, pi / 2.0)) {
      albedo +=
          2.0 * pi * weight * std::sin(theta) * std::cos(theta) * exact(values, direction(theta, 0.0), {0.0, 0.0, 1.0});
    }
    EXPECT_NEAR(albedo, 0.5 * (1.0 + normal_incidence(alpha)), 1e-8) << "alpha " << alpha;
  }
}

TEST(MicrofacetDiffuse, AlbedoScalesEachChannel) {
  ParameterValues values = surface(0.4);
  const Direction wi = from_degrees(30.0, 80.0), wo = from_degrees(55.0, 0.0);
  const double white = exact(values, wi, wo);
  values.set("albedo", std::array{0.1, 0.5, 0.9});
  const Rgb f = microfacet_diffuse().make(values)->exact(wi, wo);
  EXPECT_DOUBLE_EQ(f.x, 0.1 * white);
  EXPECT_DOUBLE_EQ(f.y, 0.5 * white);
  EXPECT_DOUBLE_EQ(f.z, 0.9 * white);
  const Estimate sampled = estimate(*microfacet_diffuse().make(values), wi, wo, {.samples = 4096});
  EXPECT_NEAR(sampled.f.x / sampled.f.z, 0.1 / 0.9, 1e-12);
  EXPECT_NEAR(sampled.stderr_f.y / sampled.stderr_f.z, 0.5 / 0.9, 1e-12);
}

// ---- visible normals --------------------------------------------------------------------------------------------

TEST(VisibleNormals, FollowTheirDensity) {
  // Pearson's test over bins in x = atan(tanθ_m / α) and the azimuth. Expected counts come from a midpoint rule of 20 ×
  // 20 per bin, whose error is far below the counts' own; bins that expect fewer than ten are pooled.
  constexpr std::size_t x_bins = 16, phi_bins = 24;
  constexpr int sub = 20;
  constexpr std::uint32_t samples = 200'000;
  double smallest_p_value = 1.0;
  std::uint64_t configuration = 0;
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {0.1, 0.8}) {
      for (const double theta : {0.0, 30.0, 60.0, 85.0, 89.0}) {
        const Direction w = from_degrees(theta, 40.0);
        std::vector<double> expected(x_bins * phi_bins, 0.0), counts(x_bins * phi_bins, 0.0);
        const double visible = w.z * (1.0 + printed_lambda(distribution, alpha, w));
        constexpr double dx = pi / 2.0 / x_bins / sub, dphi = 2.0 * pi / phi_bins / sub;
        double total = 0.0;
        for (std::size_t i = 0; i < x_bins * sub; ++i) {
          const double x = (static_cast<double>(i) + 0.5) * dx;
          const double slope = alpha * std::tan(x);
          const double measure = slope_density(distribution, alpha, slope * slope) * slope * alpha /
                                 (std::cos(x) * std::cos(x)) * dx * dphi * samples / visible;
          for (std::size_t j = 0; j < phi_bins * sub; ++j) {
            const double phi = (static_cast<double>(j) + 0.5) * dphi;
            const double facing = w.z + slope * (w.x * std::cos(phi) + w.y * std::sin(phi));
            expected[i / sub * phi_bins + j / sub] += measure * std::max(facing, 0.0);
            total += measure * std::max(facing, 0.0);
          }
        }
        EXPECT_NEAR(total / samples, 1.0, 1e-3) << "the density is not normalised: the test is wrong";

        const SamplePoints points(Sampler::philox, {3, configuration++, 0});
        for (std::uint32_t k = 0; k < samples; ++k) {
          const Direction m = sample_visible_normal(distribution, alpha, w, points(k));
          const double x = std::atan2(std::hypot(m.x, m.y), alpha * m.z);
          const double phi = std::atan2(m.y, m.x) + (m.y < 0.0 ? 2.0 * pi : 0.0);
          const auto i = std::min(x_bins - 1, static_cast<std::size_t>(x / (pi / 2.0) * x_bins));
          const auto j = std::min(phi_bins - 1, static_cast<std::size_t>(phi / (2.0 * pi) * phi_bins));
          ++counts[i * phi_bins + j];
        }
        double statistic = 0.0, pooled_expected = 0.0, pooled_count = 0.0;
        int bins = 0;
        const auto add = [&](double e, double count) {
          statistic += (count - e) * (count - e) / e;
          ++bins;
        };
        for (std::size_t bin = 0; bin < expected.size(); ++bin) {
          if (expected[bin] >= 10.0) {
            add(expected[bin], counts[bin]);
          } else {
            pooled_expected += expected[bin];
            pooled_count += counts[bin];
          }
        }
        if (pooled_expected >= 10.0) {
          add(pooled_expected, pooled_count);
        } else {
          // Too few to be tested as a bin; a Poisson mean below 10 exceeds 31 once in a million times.
          EXPECT_LE(pooled_count, 31.0);
        }
        ASSERT_GT(bins, 20);
        const double p_value = boost::math::cdf(boost::math::complement(boost::math::chi_squared(bins - 1), statistic));
        smallest_p_value = std::min(smallest_p_value, p_value);
        EXPECT_GT(p_value, false_alarm) << place(distribution, alpha, w, {}) << ": chi-squared " << statistic
                                        << " over " << bins << " bins";
      }
    }
  }
  RecordProperty("smallest_p_value", number_text(smallest_p_value));
}

TEST(VisibleNormals, OfAFullHemisphereAreCosineWeighted) {
  // GGX of α = 1 has D = 1/π: facets seen from the normal are the disk point (√u, 2πv) lifted to the sphere.
  for (std::uint32_t k = 0; k < 4096; ++k) {
    const double u = unit_interval(k * 0x9E3779B9u), v = unit_interval(k << 20);
    const Direction m = sample_visible_normal(Distribution::ggx, 1.0, {0.0, 0.0, 1.0}, {u, v});
    ASSERT_NEAR(m.x, std::sqrt(u) * std::cos(2.0 * pi * v), 2e-15) << v;
    ASSERT_NEAR(m.y, std::sqrt(u) * std::sin(2.0 * pi * v), 2e-15) << v;
    ASSERT_NEAR(m.z, std::sqrt(1.0 - u), 1e-14) << v;
  }
}

TEST(VisibleNormals, BatchesAreTheSameInFloat) {
  constexpr std::size_t count = 20011;
  const Direction w = from_degrees(70.0, 25.0);
  std::vector<float> u(count), v(count);
  SamplePoints(Sampler::philox, {5, 0, 0}).fill(0, u, v);
  std::vector<float> x(count), y(count), z(count);
  for (const Distribution distribution : both_distributions) {
    sample_visible_normals(distribution, 0.3, w, u, v, {x, y, z});
    double sum = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const Direction m = sample_visible_normal(distribution, 0.3, w, {u[i], v[i]});
      const Direction difference = Direction{x[i], y[i], z[i]} - m;
      const double error = std::sqrt(dot(difference, difference));
      // √(1 - p²) turns a rounding of 6e-8 at the rim of the disk into its root; elsewhere nothing is lost.
      ASSERT_LT(error, 5e-4) << i;
      sum += error;
    }
    EXPECT_LT(sum / count, 2e-7);
  }
}

TEST(VisibleNormals, AreVisibleUnitVectors) {
  for (const Distribution distribution : both_distributions) {
    for (const double alpha : {0.001, 0.1, 1.0}) {
      for (const double cosine : {1.0, 0.999999, 0.5, 1e-3, 1e-6, 1e-9}) {
        const Direction w{0.8 * std::sqrt((1.0 - cosine) * (1.0 + cosine)),
                          -0.6 * std::sqrt((1.0 - cosine) * (1.0 + cosine)), cosine};
        for (const std::uint32_t a : {0u, 1u, 0x40000000u, 0x80000000u, ~0u - 1u, ~0u}) {
          for (const std::uint32_t b : {0u, 1u, 0x40000000u, 0x80000000u, ~0u - 1u, ~0u}) {
            const Direction m = sample_visible_normal(distribution, alpha, w, {unit_interval(a), unit_interval(b)});
            ASSERT_NEAR(dot(m, m), 1.0, 1e-12) << place(distribution, alpha, w, m);
            ASSERT_GE(m.z, 0.0) << place(distribution, alpha, w, m);
            // Facets edge-on to w are on the boundary; rounding may put them just beyond.
            ASSERT_GE(dot(m, w), -1e-7) << place(distribution, alpha, w, m);
          }
        }
      }
    }
  }
}

// ---- Monte Carlo ------------------------------------------------------------------------------------------------

struct Configuration {
  ParameterValues values;
  Direction wi, wo;
  std::string text;
};

/// Random surfaces and directions: every distribution with every masking, α from 0.03 to 1.
std::vector<Configuration> random_configurations(std::size_t count) {
  std::vector<Configuration> configurations;
  UniformNumbers uniform(31);
  for (const auto& [wi, wo] : random_pairs(count, 30)) {
    const std::size_t index = configurations.size();
    const Distribution distribution = both_distributions[index % 2];
    const std::string_view masking = MicrofacetDiffuse::maskings[index / 2 % MicrofacetDiffuse::maskings.size()];
    const double alpha = std::pow(10.0, uniform.between(-1.5, 0.0));
    configurations.push_back({surface(alpha, masking, distribution), wi, wo,
                              std::string(masking) + ", " + place(distribution, alpha, wi, wo)});
  }
  return configurations;
}

TEST(MonteCarlo, IsWithinFourStandardErrors) {
  // |t| of 31 degrees of freedom exceeds 4 with probability 3.7e-4: one in 14 choices of the seed would fail one of
  // the two hundred comparisons.
  for (const Sampler sampler : {Sampler::sobol, Sampler::philox}) {
    double worst = 0.0;
    std::uint64_t seed = 0;
    for (const Configuration& c : random_configurations(100)) {
      const Estimate result = estimate(*microfacet_diffuse().make(c.values), c.wi, c.wo,
                                       {.samples = 1u << 13, .sampler = sampler, .seed = ++seed});
      const double error = (result.f.x - exact(c.values, c.wi, c.wo)) / result.stderr_f.x;
      worst = std::max(worst, std::abs(error));
      EXPECT_LE(std::abs(error), 4.0) << c.text;
    }
    RecordProperty(sampler == Sampler::sobol ? "worst_sobol" : "worst_philox", number_text(worst));
  }
}

TEST(MonteCarlo, StandardErrorsAreHonest) {
  // (estimate - exact)/stderr follows Student's t with 31 degrees of freedom. Mapped to standard normals, the sum of
  // their squares is chi-squared: errors that are too small and errors that are too large both fail.
  constexpr int seeds = 12;
  const boost::math::students_t student(replicate_count - 1);
  const std::vector<Configuration> configurations = random_configurations(100);
  for (const Sampler sampler : {Sampler::sobol, Sampler::philox}) {
    double sum = 0.0, squares = 0.0;
    std::uint64_t seed = 0;  // never used twice: the same numbers would make the errors of configurations alike
    for (const Configuration& c : configurations) {
      const double truth = exact(c.values, c.wi, c.wo);
      for (int repetition = 0; repetition < seeds; ++repetition) {
        const Estimate result = estimate(*microfacet_diffuse().make(c.values), c.wi, c.wo,
                                         {.samples = 2048, .sampler = sampler, .seed = ++seed});
        const double p = boost::math::cdf(student, (result.f.x - truth) / result.stderr_f.x);
        const double z = boost::math::quantile(boost::math::normal(), p);
        sum += z;
        squares += z * z;
      }
    }
    const double count = seeds * static_cast<double>(configurations.size());
    const boost::math::chi_squared chi_squared(count);
    const std::string name = sampler == Sampler::sobol ? "sobol" : "philox";
    RecordProperty("chi_squared_per_degree_" + name, number_text(squares / count));
    RecordProperty("p_value_" + name, number_text(boost::math::cdf(boost::math::complement(chi_squared, squares))));
    EXPECT_LT(squares, boost::math::quantile(boost::math::complement(chi_squared, false_alarm))) << name;
    EXPECT_GT(squares, boost::math::quantile(chi_squared, false_alarm)) << name;
    const double mean_bound = boost::math::quantile(boost::math::complement(boost::math::normal(), 0.5 * false_alarm));
    EXPECT_LT(std::abs(sum) / std::sqrt(count), mean_bound) << name << ": biased";
  }
}

TEST(MonteCarlo, FastRowsMeetThoseInDouble) {
  // Neither the number of directions nor that of samples is a multiple of a vector or block.
  UniformNumbers uniform(41);
  double worst = 0.0;
  for (int trial = 0; trial < 20; ++trial) {
    const Distribution distribution = both_distributions[static_cast<std::size_t>(trial) % 2];
    const ParameterValues values =
        surface(std::pow(10.0, uniform.between(-1.5, 0.0)),
                MicrofacetDiffuse::maskings[static_cast<std::size_t>(trial) % 5], distribution);
    std::vector<Direction> wi;
    for (const DirectionPair& pair : random_pairs(1 + static_cast<std::size_t>(trial) * 7, 42)) wi.push_back(pair.wi);
    const Direction wo = random_pairs(1, 43 + static_cast<std::uint64_t>(trial))[0].wo;
    const SamplePoints points(Sampler::sobol, {1, static_cast<std::uint64_t>(trial), 0});
    std::vector<Rgb> fast(wi.size()), slow(wi.size());
    const std::unique_ptr<const Integrator> integrator = microfacet_diffuse().make(values);
    integrator->sample_row(wo, wi, points, 1000, true, {.values = fast});
    integrator->sample_row(wo, wi, points, 1000, false, {.values = slow});
    for (std::size_t j = 0; j < wi.size(); ++j) {
      ASSERT_GT(slow[j].x, 0.0);
      const double error = std::abs(fast[j].x / slow[j].x - 1.0);
      worst = std::max(worst, error);
      EXPECT_LT(error, 2e-6) << "trial " << trial << ", direction " << j;
    }
  }
  RecordProperty("worst_relative_error", number_text(worst));
}

TEST(MonteCarlo, StopsAtTheTargetedError) {
  const ParameterValues values = surface(0.7);
  const Direction wi = from_degrees(70.0, 120.0), wo = from_degrees(40.0, 0.0);
  for (const Sampler sampler : {Sampler::sobol, Sampler::philox}) {
    for (const double target : {1e-3, 1e-4}) {
      const SamplingOptions options{.samples = 512, .stderr_target = target, .sampler = sampler};
      const Estimate result = estimate(*microfacet_diffuse().make(values), wi, wo, options);
      EXPECT_LE(result.stderr_f.x, target);
      EXPECT_EQ(result.samples % 512, 0u);
      // No sooner and no later: that many samples give that very estimate, half as many an error above the target.
      const Estimate same =
          estimate(*microfacet_diffuse().make(values), wi, wo, {.samples = result.samples, .sampler = sampler});
      EXPECT_EQ(same.f.x, result.f.x);
      EXPECT_EQ(same.stderr_f.x, result.stderr_f.x);
      ASSERT_GT(result.samples, 512u);
      const Estimate half =
          estimate(*microfacet_diffuse().make(values), wi, wo, {.samples = result.samples / 2, .sampler = sampler});
      EXPECT_GT(half.stderr_f.x, target);
    }
  }
}

TEST(MonteCarlo, SamplesAreRoundedUpToWholeReplicates) {
  const ParameterValues values = surface(0.5);
  const Direction w = from_degrees(20.0, 0.0);
  EXPECT_EQ(estimate(*microfacet_diffuse().make(values), w, w, {.samples = 1}).samples, 32u);
  EXPECT_EQ(estimate(*microfacet_diffuse().make(values), w, w, {.samples = 33}).samples, 64u);
}

TEST(References, AreFoundByName) {
  EXPECT_EQ(find_reference("microfacet_diffuse").name, "microfacet_diffuse");
  EXPECT_EQ(find_reference_or_null("microfacet_difuse"), nullptr);
  try {
    find_reference("microfacet_difuse");
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
    EXPECT_NE(std::string(error.what()).find("did you mean 'microfacet_diffuse'"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace lobefit
