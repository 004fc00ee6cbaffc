// Explicit Gaussian surfaces: their slopes and heights, the tracer against a march along the ray, conservation laws,
// and where Smith's theory holds and fails. Smith's walk against published values and the quadrature of one bounce.
//
// Statistical tests have fixed seeds. Means over 16 surfaces may leave their expected value by 8 standard errors, which
// Student's t with 15 degrees of freedom does once in a million; means over 32 replicates by 6, once in 800,000.
#include <gtest/gtest.h>

#include <cmath>

#include "models/error.h"
#include "models/geometry.h"
#include "reference/diffuse/facet_quadrature.h"
#include "reference/estimate.h"
#include "reference/height_field/paths.h"
#include "reference/height_field/smith_walk.h"
#include "reference/height_field/study.h"
#include "reference/integrator.h"

namespace lobefit {
namespace {

constexpr std::uint32_t surface_count = 16;
constexpr double surface_bound = 8.0, replicate_bound = 6.0;

Direction at(double theta, double phi) { return direction(radians(theta), radians(phi)); }

HeightField make_surface(double alpha, std::uint32_t number) {
  return HeightField::gaussian(256, 8.0, alpha, {.seed = 7, .entry = 0, .replicate = number});
}

/// Holds the mean of one number per surface to its expected value.
template <class Value>
void expect_mean(double expected, const Value& value) {
  std::vector<double> values;
  for (std::uint32_t s = 0; s < surface_count; ++s) values.push_back(value(s));
  const MeanAndError result = mean_and_error<double>(values);
  EXPECT_NEAR(result.mean, expected, surface_bound * result.standard_error + 1e-12);
}

TEST(HeightField, SlopesAreBeckmanns) {
  const double alpha = 0.7, rms = alpha / std::sqrt(2.0);
  std::vector<HeightField> surfaces;
  for (std::uint32_t s = 0; s < surface_count; ++s) surfaces.push_back(make_surface(alpha, s));
  for (const HeightField& surface : surfaces) {
    const SlopeStatistics slopes = surface.slope_statistics();
    EXPECT_NEAR(std::hypot(slopes.rms_x, slopes.rms_y), alpha, 1e-6);
  }
  expect_mean(0.0, [&](auto s) { return surfaces[s].slope_statistics().rms_x - surfaces[s].slope_statistics().rms_y; });
  expect_mean(3.0, [&](auto s) { return surfaces[s].slope_statistics().kurtosis_x; });
  expect_mean(3.0, [&](auto s) { return surfaces[s].slope_statistics().kurtosis_y; });
  expect_mean(0.0, [&](auto s) { return surfaces[s].slope_statistics().correlation; });
  for (const double theta : {0.0, 45.0, 75.0}) {
    const Direction w = at(theta, 20.0);
    const double expected = w.z * (1.0 + smith_lambda(Distribution::beckmann, alpha, w));
    std::vector<double> areas;
    for (const HeightField& surface : surfaces) areas.push_back(surface.facing_area(w));
    const MeanAndError area = mean_and_error<double>(areas);
    // Slopes are differences of floats.
    EXPECT_NEAR(area.mean, expected, surface_bound * area.standard_error + 1e-6) << theta;
  }

  // Heights have standard deviation rms ℓ/√2 and autocorrelation exp(-r²/ℓ²), within what scaling by the sampled slopes
  // and their being differences over a cell (1/(2ℓ²) = 0.8 %) leaves.
  const auto covariance = [&](std::uint32_t s, int x, int y) {
    double sum = 0.0;
    for (int row = 0; row < 256; ++row) {
      for (int column = 0; column < 256; ++column) {
        sum += static_cast<double>(surfaces[s].height(column, row)) * surfaces[s].height(column + x, row + y);
      }
    }
    return sum / (256.0 * 256.0 * 32.0 * rms * rms * (1.0 + 0.5 / 64.0));
  };
  expect_mean(1.0, [&](auto s) { return covariance(s, 0, 0); });
  expect_mean(std::exp(-1.0), [&](auto s) { return covariance(s, 8, 0); });
  expect_mean(std::exp(-1.0), [&](auto s) { return covariance(s, 0, -8); });
  expect_mean(std::exp(-2.0), [&](auto s) { return covariance(s, 8, 8); });
}

TEST(HeightField, RefusesWhatIsNoSurface) {
  EXPECT_THROW(HeightField(3, std::vector<float>(9)), Error);
  EXPECT_THROW(HeightField(4, std::vector<float>(9)), Error);
  EXPECT_THROW(HeightField::gaussian(64, 1.0, 0.5, {}), Error);
  EXPECT_THROW(HeightField::gaussian(64, 40.0, 0.5, {}), Error);
}

TEST(HeightFieldTracer, MissingPartIsNamed) {
  if (HeightFieldTracer::available()) GTEST_SKIP() << "Embree is here";
  try {
    Monitor monitor;
    study_height_field({}, monitor);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::missing_part);
    EXPECT_NE(std::string(error.what()).find("libembree-dev"), std::string::npos);
  }
}

/// Tests that trace rays.
class TracedHeightField : public testing::Test {
 protected:
  void SetUp() override {
    if (!HeightFieldTracer::available()) GTEST_SKIP() << "this build has no Embree";
  }
};

/// Height of the triangulated surface at a point of the plane, from the corners' heights alone.
double height_at(const HeightField& surface, double x, double y) {
  const double across = x + 0.5 * surface.cells(), up = y + 0.5 * surface.cells();
  const int column = static_cast<int>(std::floor(across)), row = static_cast<int>(std::floor(up));
  const double u = across - column, v = up - row;
  const double h00 = surface.height(column, row), h10 = surface.height(column + 1, row);
  const double h01 = surface.height(column, row + 1), h11 = surface.height(column + 1, row + 1);
  if ((column + row) % 2 != 0) {
    return u + v < 1.0 ? h00 + u * (h10 - h00) + v * (h01 - h00)
                       : h11 + (1.0 - u) * (h01 - h11) + (1.0 - v) * (h10 - h11);
  }
  return u > v ? h00 + u * (h10 - h00) + v * (h11 - h10) : h00 + v * (h01 - h00) + u * (h11 - h01);
}

// Every ray is marched in steps of 0.01 cells over the endlessly repeated surface: it stays above it up to where the
// tracer has it end, and there it meets it.
TEST_F(TracedHeightField, RaysEndWhereAMarchAlongThemDoes) {
  const HeightField surface = HeightField::gaussian(32, 4.0, 0.8, {.seed = 3});
  const HeightFieldTracer tracer(surface);
  const SamplePoints points(Sampler::philox, {.seed = 11});
  int seams = 0, skies = 0;
  for (std::uint32_t i = 0; i < 400; ++i) {
    const auto [u, v] = points.pair(i, 0);
    const auto [s, t] = points.pair(i, 1);
    // Downward from above, or upward from just above the surface; origins up to two patches away.
    const bool down = i % 2 == 0;
    Direction origin{128.0 * (u - 0.5), 128.0 * (v - 0.5), surface.highest() + 0.25};
    if (!down) origin.z = height_at(surface, origin.x, origin.y) + 0.02;
    const Direction w = at(s * 87.0, 360.0 * t) * (down ? -1.0 : 1.0);
    const Encounter encounter = tracer.trace(origin, w);
    ASSERT_NE(encounter.what, Encounter::What::lost);
    EXPECT_EQ(tracer.sees_sky(origin, w), encounter.what == Encounter::What::sky);
    const double step = 0.01;
    const auto clearance = [&](double distance) {
      const Direction p = origin + distance * w;
      return p.z - height_at(surface, p.x, p.y);
    };
    double distance = 0.0;
    Direction p = origin;
    while (clearance(distance) > 0.0 && p.z < surface.highest() + 1.0) p = origin + (distance += step) * w;
    if (encounter.what == Encounter::What::sky) {
      ++skies;
      EXPECT_GE(p.z, surface.highest() + 1.0) << i;
      continue;
    }
    // The point is that of the march, up to whole patches and the last step.
    const auto apart = [](double a, double b) { return std::abs(std::remainder(a - b, 32.0)); };
    EXPECT_LT(apart(p.x, encounter.point.x), 0.05) << i;
    EXPECT_LT(apart(p.y, encounter.point.y), 0.05) << i;
    EXPECT_NEAR(height_at(surface, encounter.point.x, encounter.point.y), encounter.point.z, 1e-3);
    EXPECT_LT(dot(encounter.normal, w), 0.0);
    seams += std::floor(p.x / 32.0 + 0.5) != std::floor(origin.x / 32.0 + 0.5) ||
             std::floor(p.y / 32.0 + 0.5) != std::floor(origin.y / 32.0 + 0.5);
  }
  EXPECT_GT(seams, 50);
  EXPECT_GT(skies, 50);
}

TEST_F(TracedHeightField, FlatSurfaceIsLambert) {
  const HeightField surface = HeightField::gaussian(32, 4.0, 0.0, {});
  const HeightFieldTracer tracer(surface);
  const std::vector<Direction> wi{at(0.0, 0.0), at(60.0, 90.0), at(85.0, 180.0)};
  ScatteringOrders sums(3, wi.size());
  add_paths(tracer, at(70.0, 0.0), wi, SamplePoints(Sampler::sobol, {}), 0, 1000, sums);
  sums.divide_by(1000.0);
  for (std::size_t j = 0; j < wi.size(); ++j) {
    EXPECT_NEAR(sums.brdf[j], 1.0 / pi, 1e-12);
    EXPECT_EQ(sums.brdf[wi.size() + j], 0.0);
  }
  EXPECT_EQ(sums.albedo[0], 1.0);
  EXPECT_EQ(sums.lost, 0u);
}

// Every path escapes, so the orders' albedos sum to 1 at unit albedo. What they are is told twice: by counting escapes,
// and by next-event estimation at lights spread uniformly over the hemisphere.
TEST_F(TracedHeightField, OrdersConserveEnergyAndAgreeWithNextEvents) {
  const Direction wo = at(70.0, 0.0);
  constexpr std::uint32_t paths = 4096;
  std::array<std::vector<double>, 3> differences;
  for (std::uint32_t s = 0; s < surface_count; ++s) {
    const HeightField surface = make_surface(1.0, s);
    const HeightFieldTracer tracer(surface);
    const SamplePoints points(Sampler::sobol, {.seed = 5, .entry = 1, .replicate = s});
    const SamplePoints lights(Sampler::sobol, {.seed = 5, .entry = 2, .replicate = s});
    std::array<double, 3> escaped{}, next_event{};
    for (std::uint32_t i = 0; i < paths; ++i) {
      const auto [u, v] = lights(i);
      const std::array<Direction, 1> wi{direction(std::acos(u), 2.0 * pi * v)};
      ScatteringOrders sums(3, 1);
      add_paths(tracer, wo, wi, points, i, 1, sums);
      ASSERT_EQ(sums.lost, 0u);
      EXPECT_EQ(sums.albedo[0] + sums.albedo[1] + sums.albedo[2], 1.0);
      for (std::size_t k = 0; k < 3; ++k) {
        escaped[k] += sums.albedo[k] / paths;
        next_event[k] += 2.0 * pi * wi[0].z * sums.brdf[k] / paths;
      }
    }
    for (std::size_t k = 0; k < 3; ++k) differences[k].push_back(next_event[k] - escaped[k]);
  }
  for (const std::vector<double>& difference : differences) {
    const MeanAndError mean = mean_and_error<double>(difference);
    EXPECT_NEAR(mean.mean, 0.0, surface_bound * mean.standard_error);
    EXPECT_LT(mean.standard_error, 0.004);  // the test has teeth
  }
}

TEST_F(TracedHeightField, IsReciprocal) {
  const Direction a = at(75.0, 0.0), b = at(40.0, 60.0);
  constexpr std::uint32_t paths = 8192;
  std::array<std::vector<double>, 2> differences;
  for (std::uint32_t s = 0; s < surface_count; ++s) {
    const HeightField surface = make_surface(0.8, s);
    const HeightFieldTracer tracer(surface);
    ScatteringOrders forth(3, 1), back(3, 1);
    add_paths(tracer, a, {&b, 1}, SamplePoints(Sampler::sobol, {5, 1, s}), 0, paths, forth);
    add_paths(tracer, b, {&a, 1}, SamplePoints(Sampler::sobol, {5, 2, s}), 0, paths, back);
    for (std::size_t k = 0; k < 2; ++k) differences[k].push_back(pi * (forth.brdf[k] - back.brdf[k]) / paths);
  }
  for (const std::vector<double>& difference : differences) {
    const MeanAndError mean = mean_and_error<double>(difference);
    EXPECT_NEAR(mean.mean, 0.0, surface_bound * mean.standard_error);
    EXPECT_LT(mean.standard_error, 0.003);
  }
}

// What of the facets a direction sees, seen from there, is as large as the macroscopic surface: ∫ (m·w)⁺ V dA = cosθ,
// whatever the surface. And a facet that the view sees is never shadowed from the view's own direction.
TEST_F(TracedHeightField, VisibleProjectedAreaIsThatOfThePlane) {
  const Direction w = at(75.0, 30.0);
  constexpr std::uint32_t samples = 8192;
  std::vector<double> areas;
  std::uint32_t shadowed = 0;
  for (std::uint32_t s = 0; s < surface_count; ++s) {
    const HeightField surface = make_surface(0.8, s);
    const HeightFieldTracer tracer(surface);
    const SamplePoints points(Sampler::sobol, {.seed = 5, .entry = 1, .replicate = s});
    double area = 0.0;
    for (std::uint32_t i = 0; i < samples; ++i) {
      const auto [x, y] = points.pair(i, 0);
      const Direction over{256.0 * (x - 0.5), 256.0 * (y - 0.5), surface.highest() + 0.5};
      const Encounter below = tracer.trace(over, {0.0, 0.0, -1.0});
      const double cosine = dot(below.normal, w);
      if (cosine > 0.0 && tracer.sees_sky(below.point, w)) area += cosine / below.normal.z / samples;
      const Encounter seen = tracer.trace(over, -w);
      shadowed += !tracer.sees_sky(seen.point, w);
    }
    areas.push_back(area);
  }
  const MeanAndError area = mean_and_error<double>(areas);
  EXPECT_NEAR(area.mean, w.z, surface_bound * area.standard_error);
  EXPECT_LT(area.standard_error, 0.002);
  // Points are moved by a thousandth of a cell, some of them behind what they touched in passing.
  EXPECT_LT(shadowed, 1e-3 * surface_count * samples);
}

TEST_F(TracedHeightField, SmithHoldsNearTheNormalAndFailsAtGrazingRetro) {
  Monitor monitor;
  const HeightFieldStudy study = study_height_field(
      {.alpha = 0.5, .surfaces = 16, .cells = 256, .correlation_length = 8.0, .samples = 8192}, monitor);
  EXPECT_EQ(study.lost, 0u);
  EXPECT_EQ(study.degrees_of_freedom(), 15);
  const auto find = [&](double theta_o, double theta_i, double phi) {
    for (const HeightFieldPair& pair : study.pairs) {
      if (pair.theta_o == theta_o && pair.theta_i == theta_i && pair.phi == phi) return pair;
    }
    ADD_FAILURE() << "no such pair";
    return HeightFieldPair{};
  };
  for (const auto& [theta_i, phi] : {std::array{30.0, 0.0}, std::array{30.0, 90.0}, std::array{30.0, 180.0}}) {
    const Comparison one = find(30.0, theta_i, phi).first;
    EXPECT_LT(std::abs(one.deviations()), surface_bound);
    EXPECT_LT(std::abs(one.difference()), 0.005);
  }
  EXPECT_LT(std::abs(find(0.0, 0.0, 0.0).second.difference()), 0.05);
  // Longer surfaces (16 of 1024 cells, ℓ = 16) put these at +32 %, -12 % and -28 %.
  const HeightFieldPair retro = find(80.0, 80.0, 0.0), mirror = find(80.0, 80.0, 180.0);
  EXPECT_GT(retro.first.deviations(), 5.0);
  EXPECT_NEAR(retro.first.difference(), 0.31, 0.05);
  EXPECT_GT(retro.first.surface.mean, retro.separable);
  EXPECT_LT(mirror.first.deviations(), -5.0);
  EXPECT_LT(mirror.second.deviations(), -5.0);
  EXPECT_NEAR(mirror.second.difference(), -0.28, 0.08);
  EXPECT_NE(study.conclusion().find("on the retro side"), std::string::npos) << study.conclusion();
  // Without masking the theory is reciprocal, and never darker than with it.
  EXPECT_DOUBLE_EQ(find(60.0, 80.0, 90.0).unmasked, find(80.0, 60.0, 90.0).unmasked);
  EXPECT_GT(mirror.unmasked, mirror.first.smith.mean);
  EXPECT_GT(mirror.first.smith.mean, mirror.separable);
  for (const HeightFieldView& view : study.views) {
    EXPECT_NEAR(view.first.surface.mean + view.second.surface.mean + view.rest.surface.mean, 1.0, 1e-12);
    EXPECT_NEAR(view.first.smith.mean + view.second.smith.mean + view.rest.smith.mean, 1.0, 1e-12);
  }
  EXPECT_EQ(study.slice(60.0).size(), 35u);
  EXPECT_EQ(study.slice(0.0).size(), 35u);
}

/// 32 independent means of so many walks.
std::vector<ScatteringOrders> smith_replicates(Distribution distribution, double alpha, const Direction& wo,
                                               std::span<const Direction> wi, std::uint32_t walks) {
  std::vector<ScatteringOrders> replicates;
  for (std::uint32_t r = 0; r < replicate_count; ++r) {
    replicates.emplace_back(3, wi.size());
    const SamplePoints points(Sampler::sobol, {.seed = 9, .entry = 1, .replicate = r});
    add_smith_walks(distribution, alpha, wo, wi, points, 0, walks, replicates.back());
    replicates.back().divide_by(walks);
  }
  return replicates;
}

// GGX, alpha ½, 60° on both sides: one bounce, and all of them at unit albedo.
TEST(SmithWalk, ReproducesKnownValues) {
  const std::vector<Direction> wi{at(60.0, 0.0), at(60.0, 180.0)};
  const std::array<double, 2> one{0.361554992058, 0.127865601469}, all{0.427015898, 0.223878907};
  const auto replicates = smith_replicates(Distribution::ggx, 0.5, at(60.0, 0.0), wi, 32768);
  for (std::size_t j = 0; j < 2; ++j) {
    std::vector<double> first, sum;
    for (const ScatteringOrders& r : replicates) {
      first.push_back(r.brdf[j]);
      sum.push_back(r.brdf[j] + r.brdf[2 + j] + r.brdf[4 + j]);
    }
    const MeanAndError f1 = mean_and_error<double>(first), f = mean_and_error<double>(sum);
    EXPECT_NEAR(f1.mean, one[j], replicate_bound * f1.standard_error);
    EXPECT_NEAR(f.mean, all[j], replicate_bound * f.standard_error);
    EXPECT_LT(f.standard_error, 2e-4);
  }
}

TEST(SmithWalk, FirstBounceIsTheQuadraturesAndWalksConserveEnergy) {
  for (const double alpha : {0.2, 1.0}) {
    const Direction wo = at(75.0, 0.0);
    const std::vector<Direction> wi{at(75.0, 0.0), at(20.0, 90.0), at(80.0, 180.0)};
    const auto replicates = smith_replicates(Distribution::beckmann, alpha, wo, wi, 4096);
    for (std::size_t j = 0; j < wi.size(); ++j) {
      std::vector<double> first;
      for (const ScatteringOrders& r : replicates) first.push_back(r.brdf[j]);
      const MeanAndError f1 = mean_and_error<double>(first);
      const double expected = shared_visibility(Distribution::beckmann, alpha, wi[j], wo) /
                              (pi * wi[j].z * wo.z *
                               (1.0 + smith_lambda(Distribution::beckmann, alpha, wi[j]) +
                                smith_lambda(Distribution::beckmann, alpha, wo)));
      EXPECT_NEAR(f1.mean, expected, replicate_bound * f1.standard_error) << alpha << " " << j;
      EXPECT_LT(f1.standard_error, 2e-3 * expected);
    }
    for (const ScatteringOrders& r : replicates) EXPECT_NEAR(r.albedo[0] + r.albedo[1] + r.albedo[2], 1.0, 1e-12);
  }
}

// The reference integrator has the orders by quadrature, from an equation of its own; the walk witnesses for them.
TEST(SmithWalk, WitnessesForTheReferencesOrders) {
  const Reference reference = microfacet_diffuse_reference();
  const Direction wo = at(75.0, 0.0);
  const std::vector<Direction> wi{at(75.0, 0.0), at(20.0, 90.0), at(80.0, 180.0)};
  for (const Distribution distribution : {Distribution::ggx, Distribution::beckmann}) {
    ParameterValues values = reference.defaults();
    values.set("alpha", 0.7);
    values.set("albedo", 1.0);
    values.set_text("distribution", distribution == Distribution::ggx ? "ggx" : "beckmann");
    values.set_text("bounces", "all");
    const auto integrator = reference.make(values);
    std::vector<Rgb> all(wi.size());
    std::vector<double> orders(static_cast<std::size_t>(integrator->orders()) * wi.size());
    integrator->exact_row(wo, wi, {.values = all, .orders = orders});
    const auto replicates = smith_replicates(distribution, 0.7, wo, wi, 8192);
    for (std::size_t j = 0; j < wi.size(); ++j) {
      const auto expect = [&](double expected, const auto& value) {
        std::vector<double> means;
        for (const ScatteringOrders& r : replicates) means.push_back(value(r));
        const MeanAndError mean = mean_and_error<double>(means);
        EXPECT_NEAR(mean.mean, expected, replicate_bound * mean.standard_error) << j;
        EXPECT_LT(mean.standard_error, 0.02 * expected) << j;
      };
      expect(orders[j], [&](const ScatteringOrders& r) { return r.brdf[j]; });
      expect(orders[3 + j], [&](const ScatteringOrders& r) { return r.brdf[3 + j]; });
      expect(all[j].x, [&](const ScatteringOrders& r) { return r.brdf[j] + r.brdf[3 + j] + r.brdf[6 + j]; });
    }
  }
}

// The normals that a rising ray meets, against the density (w·m)⁺ D, by rejection from all facets.
TEST(SmithWalk, VisibleNormalsFromBelow) {
  const Direction w = at(110.0, 25.0);
  for (const Distribution distribution : {Distribution::ggx, Distribution::beckmann}) {
    std::vector<double> differences;
    for (std::uint32_t r = 0; r < replicate_count; ++r) {
      const SamplePoints points(Sampler::philox, {.seed = 13, .entry = 1, .replicate = r});
      constexpr std::uint32_t samples = 16384;
      double sampled = 0.0, weighted = 0.0, weights = 0.0;
      for (std::uint32_t i = 0; i < samples; ++i) {
        const auto [u, unused] = points.pair(i, 0);
        const Direction m = smith_visible_normal(distribution, 0.6, w, u, points.pair(i, 1));
        EXPECT_GE(dot(m, w), -1e-9);
        sampled += (m.x + 2.0 * m.z) / samples;
        // All facets: relative slope τ with distribution 1 - 1/(1 + τ²) or 1 - exp(-τ²), seen from above D cosθ.
        const auto [a, b] = points.pair(i, 2);
        const double tau = distribution == Distribution::ggx ? std::sqrt(a / (1.0 - a)) : std::sqrt(-std::log(1.0 - a));
        const Direction any =
            normalize(Direction{0.6 * tau * std::cos(2.0 * pi * b), 0.6 * tau * std::sin(2.0 * pi * b), 1.0});
        const double weight = max(dot(any, w), 0.0) / any.z;
        weights += weight;
        weighted += weight * (any.x + 2.0 * any.z);
      }
      differences.push_back(sampled - weighted / weights);
    }
    const MeanAndError difference = mean_and_error<double>(differences);
    // A ratio of means is off by the order of its variance.
    EXPECT_NEAR(difference.mean, 0.0, replicate_bound * difference.standard_error + 1e-3);
    EXPECT_LT(difference.standard_error, 0.01);
  }
}

}  // namespace
}  // namespace lobefit
