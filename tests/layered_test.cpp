// The layered reference against closed forms, against adding-doubling, and against itself.
//
// Estimates have 32 replicates, so their error has 31 degrees of freedom: a correct estimator leaves 3 standard errors
// with probability 0.0053 and 4 with 0.00037. Seeds are fixed; each test states how often it would fail under fresh
// ones.
#include "reference/layered/layered_surface.h"
#include "reference/output_file.h"

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <chrono>
#include <ctime>
#include <functional>

#include "models/microfacet/fresnel.h"
#include "reference/estimate.h"
#include "reference/layered/adding_doubling.h"
#include "reference/specular/rough_interface.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/replicates.h"

namespace lobefit {
namespace {

LayerStack stack_of(const std::string& text) {
  const Json json = parse_json(text, "stack");
  return LayerStack::from_json(JsonReader(json, "stack"));
}

std::string layers(const std::string& list) { return "{\"layers\":[" + list + "]}"; }

Rgb one_sample_row(const Integrator& surface, const Direction& wi, const Direction& wo, const SamplePoints& points,
                   std::uint32_t samples) {
  Rgb value;
  surface.sample_row(wo, {&wi, 1}, points, samples, false, {.values = {&value, 1}});
  return value;
}

RgbEstimate estimate_value(const Integrator& surface, const Direction& wi, const Direction& wo, std::uint32_t samples,
                           std::uint64_t seed = 1) {
  return replicates(seed, [&](const SamplePoints& points) { return one_sample_row(surface, wi, wo, points, samples); });
}

double transmittance(double cosine, double ior) { return 1.0 - DielectricFresnel::evaluate(cosine, ior); }

double refracted_cosine(double cosine, double ior) { return std::sqrt(1.0 - (1.0 - cosine * cosine) / (ior * ior)); }

/// 2 ∫ F(μ) exp(-2 depth/μ) μ dμ from inside: what comes back from the top of a coat of diffuse light.
double internal_reflectance(double ior, double depth) {
  const double critical = std::sqrt(1.0 - 1.0 / (ior * ior));
  double sum = 0.0;
  // Squared steps above the critical angle, where F has a vertical tangent.
  for (const auto& [t, weight] : gauss_legendre(200, 0.0, 1.0)) {
    const double below = critical * t, above = critical + (1.0 - critical) * t * t;
    sum += weight * critical * 2.0 * below * std::exp(-2.0 * depth / below);
    sum += weight * (1.0 - critical) * 2.0 * t * 2.0 * above * std::exp(-2.0 * depth / above) *
           DielectricFresnel::evaluate(above, 1.0 / ior);
  }
  return sum;
}

// Saunderson's formula with exact Fresnel. 16 comparisons at 3 standard errors: 8 %.
TEST(Layered, SmoothCoatOverLambertIsSaunderson) {
  const struct { double ior, published; } cases[] = {{1.3, .4445}, {1.4, .5290}, {1.5, .5963}, {1.6, .6509}};
  for (const auto& [ior, published] : cases) {
    const double internal = internal_reflectance(ior, 0.0);
    EXPECT_NEAR(internal, published, 5.1e-5);
    for (const double albedo : {.2, .5, .8, 1.0}) {
      const LayeredSurface surface(stack_of(layers("{\"interface\":{\"ior\":" + std::to_string(ior) +
                                                   "}},{\"diffuse\":{\"albedo\":" + std::to_string(albedo) + "}}")));
      EXPECT_EQ(surface.channels(), 1);
      const Direction wi = direction(radians(30.0 + 30.0 * albedo), 0.3), wo = direction(radians(20.0), 2.0);
      const double truth =
          transmittance(wi.z, ior) * transmittance(wo.z, ior) * albedo / (pi * ior * ior * (1.0 - albedo * internal));
      const RgbEstimate estimate = estimate_value(surface, wi, wo, 4096);
      EXPECT_LT(std::abs(estimate.distance(truth)), 3.0) << ior << " " << albedo;
      EXPECT_LT(estimate.error(), 0.002 * truth);
    }
  }
}

// Beer's law along the refracted paths, and along the diffuse light between the Lambertian bottom and the interface.
// 9 comparisons at 3 standard errors: 5 %.
TEST(Layered, PureAbsorptionIsBeer) {
  const LayeredSurface surface(stack_of(layers(
      R"({"interface":{"ior":1.5}},{"medium":{"mean_free_path":[2,1,0.25],"albedo":0,"g":0.3,"thickness":0.3}},
         {"diffuse":{"albedo":[0.9,0.8,0.7]}})")));
  EXPECT_EQ(surface.channels(), 3);
  const std::array depth{0.15, 0.3, 1.2}, albedo{0.9, 0.8, 0.7};
  for (const double theta : {0.0, 40.0, 80.0}) {
    const Direction wi = direction(radians(theta), 0.0), wo = direction(radians(55.0), 1.0);
    const RgbEstimate estimate = estimate_value(surface, wi, wo, 8192);
    for (std::size_t c = 0; c < 3; ++c) {
      const double path = 1.0 / refracted_cosine(wi.z, 1.5) + 1.0 / refracted_cosine(wo.z, 1.5);
      const double truth = transmittance(wi.z, 1.5) * transmittance(wo.z, 1.5) * std::exp(-depth[c] * path) *
                           albedo[c] / (pi * 2.25 * (1.0 - albedo[c] * internal_reflectance(1.5, depth[c])));
      EXPECT_LT(std::abs(estimate.channel[c].mean - truth), 3.0 * estimate.channel[c].standard_error) << theta;
      EXPECT_LT(estimate.channel[c].standard_error, 0.01 * truth);
    }
  }
}

double phase(double g, double cosine) {
  return (1.0 - g * g) / (4.0 * pi) * std::pow(1.0 + g * g - 2.0 * g * cosine, -1.5);
}

/// Light scattered once, per albedo, by a bare medium over a mirror of Schlick's reflectance of f0.
double scattered_once(double depth, double g, double f0, bool mirror, const Direction& wi, const Direction& wo) {
  const double reflected_i = mirror ? SchlickFresnel::evaluate(wi.z, f0, 1.0) : 0.0;
  const double reflected_o = mirror ? SchlickFresnel::evaluate(wo.z, f0, 1.0) : 0.0;
  const double across = wi.x * wo.x + wi.y * wo.y;
  double sum = 0.0;
  for (const auto& [tau, weight] : gauss_legendre(64, 0.0, depth)) {
    const double down_i = std::exp(-tau / wi.z), up_i = reflected_i * std::exp((tau - 2.0 * depth) / wi.z);
    const double down_o = std::exp(-tau / wo.z), up_o = reflected_o * std::exp((tau - 2.0 * depth) / wo.z);
    sum += weight * ((down_i * down_o + up_i * up_o) * phase(g, -wi.z * wo.z - across) +
                     (down_i * up_o + up_i * down_o) * phase(g, wi.z * wo.z - across));
  }
  return sum / (wi.z * wo.z);
}

// At an albedo of 1e-7 light scatters once or not at all. 18 comparisons at 4 standard errors: 0.7 %.
TEST(Layered, OneScatteringInABareMedium) {
  for (const double g : {-0.5, 0.0, 0.7}) {
    const std::string medium =
        R"({"medium":{"mean_free_path":1,"albedo":1e-7,"thickness":0.4,"g":)" + std::to_string(g) + "}},";
    const LayeredSurface over_black(stack_of(layers(medium + R"({"diffuse":{"albedo":0}})")));
    const LayeredSurface over_mirror(stack_of(layers(medium + R"({"conductor":{"f0":0.8}})")));
    for (const double phi : {20.0, 100.0, 170.0}) {
      const Direction wi = direction(radians(50.0), 0.4), wo = direction(radians(65.0), 0.4 + radians(phi));
      // In closed form over black.
      const double bare = phase(g, -dot(wi, wo)) * (1.0 - std::exp(-0.4 * (1.0 / wi.z + 1.0 / wo.z))) / (wi.z + wo.z);
      EXPECT_NEAR(scattered_once(0.4, g, 0.0, false, wi, wo), bare, 1e-12 * bare);
      const RgbEstimate black = estimate_value(over_black, wi, wo, 4096);
      EXPECT_LT(std::abs(black.distance(1e-7 * bare)), 4.0) << g << " " << phi;
      EXPECT_LT(black.error(), 0.003 * black.mean());
      const RgbEstimate mirror = estimate_value(over_mirror, wi, wo, 4096);
      EXPECT_LT(std::abs(mirror.distance(1e-7 * scattered_once(0.4, g, 0.8, true, wi, wo))), 4.0) << g << " " << phi;
      EXPECT_LT(mirror.error(), 0.005 * mirror.mean());
    }
  }
}

TEST(Layered, BareBottomsAreTheirBrdf) {
  const Direction wi = direction(radians(30.0), 0.4), wo = direction(radians(65.0), 2.0);
  const LayeredSurface lambert(stack_of(layers(R"({"diffuse":{"albedo":[0.1,0.5,1]}})")));
  const RgbEstimate diffuse = estimate_value(lambert, wi, wo, 4);
  EXPECT_NEAR(diffuse.channel[0].mean, 0.1 / pi, 1e-15);
  EXPECT_NEAR(diffuse.channel[2].mean, 1.0 / pi, 1e-15);
  const LayeredSurface metal(
      stack_of(layers(R"({"conductor":{"eta":[0.2,0.4,1.4],"k":[3.9,2.5,1.9],"alpha":0.3,"bounces":1}})")));
  const Rgb facets =
      RoughInterface({Distribution::ggx, 0.3, 0.3}, FacetReflectance::conductor({0.2, 0.4, 1.4}, {3.9, 2.5, 1.9}), 1)
          .evaluate_single(wo, wi);
  EXPECT_NEAR(estimate_value(metal, wi, wo, 4).channel[1].mean, facets.y, 1e-14);
  // Mirrors behind smooth interfaces are all delta.
  const LayeredSurface mirror(stack_of(layers(R"({"interface":{"ior":1.5}},{"conductor":{"f0":0.9}})")));
  EXPECT_EQ(estimate_value(mirror, wi, direction(radians(30.0), 0.4 + pi), 64).mean(), 0.0);
}

// Facets of a rough diffuse bottom against the reference of their own, α=½, θ = 60°: f/ρ (formulas.md, section 3).
// 2 comparisons at 4 standard errors: 0.1 %.
TEST(Layered, RoughDiffuseBottom) {
  const LayeredSurface surface(stack_of(layers(R"({"diffuse":{"albedo":1,"alpha":0.5}})")));
  const Direction wo = direction(radians(60.0), 0.0);
  EXPECT_LT(std::abs(estimate_value(surface, wo, wo, 4096).distance(0.361554992058)), 4.0);
  EXPECT_LT(std::abs(estimate_value(surface, direction(radians(60.0), pi), wo, 4096).distance(0.127865601469)), 4.0);
}

// The white furnace: a rough coat, n = 1.5, over a white Lambertian bottom, viewed at cos θ = ½. Walks between facets
// and bottom lose nothing, so that the albedo by escaping paths is 1 to rounding; f integrated over random lights must
// agree. One bounce loses what formulas.md, section 7 says at α = .1 and .3; at .8 it says .37, but adding-doubling
// confirms .317. 9 comparisons at 4 standard errors: 0.3 %.
TEST(Layered, WhiteFurnace) {
  const Direction wo = direction(radians(60.0), 0.0);
  for (const double alpha : {0.1, 0.3, 0.8}) {
    const auto furnace = [&](const char* bounces) {
      return stack_of(layers(R"({"interface":{"ior":1.5,"alpha":)" + std::to_string(alpha) + R"(,"bounces":)" +
                             bounces + R"(}},{"diffuse":{"albedo":1}})"));
    };
    const LayeredSurface all(furnace("\"all\"")), single(furnace("1"));
    const auto albedo = [&](const LayeredSurface& surface) {
      return replicates(1, [&](const SamplePoints& points) { return surface.sample_albedo(wo, points, 4096); });
    };
    const RgbEstimate kept = albedo(all), lost = albedo(single);
    EXPECT_NEAR(kept.mean(), 1.0, 1e-12);

    // Lights half by their cosine, half in the mirror lobe.
    const RoughInterface mirror({Distribution::ggx, alpha, alpha}, FacetReflectance::schlick({1, 1, 1}, {1, 1, 1}), 1);
    const auto integrate = [&](const LayeredSurface& surface) {
      return replicates(2, [&](const SamplePoints& points) {
        constexpr std::uint32_t groups = 64, count = 16;
        double sum = 0.0;
        for (std::uint32_t group = 0; group < groups; ++group) {
          std::vector<Direction> wi;
          for (std::uint32_t k = 0; k < count; ++k) {
            // Not all numbers of one parity: they fill half of the square.
            PathNumbers numbers(points, (group * count + k) / 2);
            const auto [u, v] = numbers.next_pair();
            wi.push_back(direction(std::acos(std::sqrt(u)), 2.0 * pi * v));
            if (k % 2 == 1) wi.back() = mirror.sample(wo, numbers).direction;
          }
          std::vector<Rgb> values(count);
          const auto replicate = static_cast<std::uint32_t>(points(0)[0] * 0x1p32);
          surface.sample_row(wo, wi, SamplePoints(Sampler::sobol, {3, group, replicate}), 16, false,
                             {.values = values});
          for (std::uint32_t k = 0; k < count; ++k) {
            if (!(wi[k].z > 0.0)) continue;
            sum += values[k].x * wi[k].z / (0.5 * wi[k].z / pi + 0.5 * mirror.pdf(wo, wi[k])) / (groups * count);
          }
        }
        return Rgb{sum, sum, sum};
      });
    };
    const RgbEstimate all_integral = integrate(all), single_integral = integrate(single);
    std::printf("white furnace, alpha %.1f: all bounces %.12f (integral of f %.4f +- %.4f), ", alpha, kept.mean(),
                all_integral.mean(), all_integral.error());
    std::printf("one bounce %.4f +- %.4f (integral of f %.4f +- %.4f)\n", lost.mean(), lost.error(),
                single_integral.mean(), single_integral.error());
    EXPECT_LT(std::abs(all_integral.distance(1.0)), 4.0);
    EXPECT_LT(std::abs(single_integral.mean() - lost.mean()), 4.0 * std::hypot(single_integral.error(), lost.error()));
    if (alpha == 0.1) {
      EXPECT_NEAR(lost.mean(), 0.92, 0.005);
      continue;
    }
    if (alpha == 0.3) {
      EXPECT_NEAR(lost.mean(), 0.68, 0.005);
    }
    AddingDoublingOptions options;
    options.streams = 32;
    options.modes = 1;
    const AddingDoubling exact(furnace("1"), {}, {&wo.z, 1}, options);
    // From 24 to 32 streams the quadrature of these lobes moves by less than 3e-4.
    EXPECT_NEAR(lost.mean(), exact.albedo(0).x, 4.0 * lost.error() + 3e-4);
  }
}

/// A stack of one to three smooth interfaces with media between them, over some bottom.
std::string random_stack(UniformNumbers& uniform) {
  const auto number = [&](double lower, double upper) { return std::to_string(uniform.between(lower, upper)); };
  std::string list;
  const int count = 1 + static_cast<int>(3.0 * uniform());
  for (int k = 0; k < count; ++k) {
    if (k > 0 || uniform() < 0.8) list += "{\"interface\":{\"ior\":" + number(1.0, 1.9) + "}},";
    list += "{\"medium\":{\"mean_free_path\":1,\"albedo\":" + number(0.2, 1.0) + ",\"g\":" + number(-0.4, 0.4) +
            ",\"thickness\":" + number(0.02, 1.5) + "}},";
  }
  const double kind = uniform();
  if (kind < 0.5) {
    list += "{\"diffuse\":{\"albedo\":" + number(0.0, 1.0) + "}}";
  } else if (kind < 0.75) {
    list += "{\"conductor\":{\"f0\":" + number(0.2, 1.0) + "}}";
  } else {
    list += "{\"interface\":{\"ior\":" + number(1.0, 1.9) + "}}";
  }
  return layers(list);
}

// Both solvers on 50 random stacks, pointwise. |g| ≤ 0.4: 14 azimuthal modes leave 1e-5. One beyond 3 standard errors:
// 23 %; χ² outside its 99.8 % interval (of normal errors, widened by 31/29): 0.2 %.
TEST(Layered, AgreesWithAddingDoublingOnRandomStacks) {
  UniformNumbers uniform(20181);
  std::array<std::string, 50> stacks;
  std::array<double, 50> distances{}, relative{};
  std::array<Direction, 50> wi, wo;
  for (std::size_t k = 0; k < stacks.size(); ++k) {
    stacks[k] = random_stack(uniform);
    wi[k] = direction(radians(uniform.between(0.0, 85.0)), 0.0);
    wo[k] = direction(radians(uniform.between(0.0, 85.0)), uniform.between(0.0, pi));
  }
  tbb::parallel_for(std::size_t{0}, stacks.size(), [&](std::size_t k) {
    const LayerStack stack = stack_of(stacks[k]);
    AddingDoublingOptions options;
    options.streams = 12;
    options.modes = 14;
    const AddingDoubling exact(stack, {&wi[k].z, 1}, {&wo[k].z, 1}, options);
    const double truth = exact.value(0, 0, std::atan2(wo[k].y, wo[k].x)).x;
    const RgbEstimate estimate = estimate_value(LayeredSurface(stack), wi[k], wo[k], 1500);
    distances[k] = estimate.distance(truth);
    relative[k] = estimate.error() / truth;
  });
  double chi2 = 0.0;
  for (std::size_t k = 0; k < stacks.size(); ++k) {
    chi2 += distances[k] * distances[k];
    EXPECT_LT(std::abs(distances[k]), 3.0) << stacks[k];
  }
  std::sort(relative.begin(), relative.end());
  std::printf("50 random stacks: chi2 %.1f, median standard error %.2f %%, largest %.2f %%\n", chi2,
              100.0 * relative[25], 100.0 * relative[49]);
  EXPECT_GT(chi2, 25.0);
  EXPECT_LT(chi2, 93.0);
}

// Rough interfaces and conductors of one bounce, azimuthal means. 8 comparisons at 4 standard errors: 0.3 %.
TEST(Layered, RoughInterfacesAgreeWithAddingDoubling) {
  const std::array stacks{
      layers(R"({"interface":{"ior":1.5,"alpha":0.5,"bounces":1}},{"diffuse":{"albedo":0.5}})"),
      layers(R"({"interface":{"ior":1.5,"alpha":0.4,"bounces":1}},
                {"medium":{"mean_free_path":1,"albedo":0.9,"g":0.4,"thickness":0.5}},{"diffuse":{"albedo":0.6}})"),
      layers(R"({"interface":{"ior":1.3}},{"medium":{"mean_free_path":1,"albedo":0.9,"g":0.4,"thickness":0.5}},
                {"conductor":{"f0":0.8,"alpha":0.5,"bounces":1}})"),
      layers(R"({"interface":{"ior":1.5,"alpha":0.6,"bounces":1}},
                {"medium":{"mean_free_path":1,"albedo":0.7,"g":-0.2,"thickness":0.3}},
                {"interface":{"ior":1.2,"alpha":0.5,"bounces":1}},{"conductor":{"f0":0.8,"alpha":0.5,"bounces":1}})")};
  for (const std::string& text : stacks) {
    const LayerStack stack = stack_of(text);
    const LayeredSurface surface(stack);
    const std::array cosines_i{std::cos(radians(40.0))};
    const std::array cosines_o{std::cos(radians(10.0)), std::cos(radians(60.0))};
    AddingDoublingOptions options;
    options.streams = 16;
    options.modes = 1;
    const AddingDoubling exact(stack, cosines_i, cosines_o, options);
    for (std::size_t o = 0; o < cosines_o.size(); ++o) {
      constexpr int azimuths = 64;
      std::vector<Direction> wi;
      for (int k = 0; k < azimuths; ++k) wi.push_back(direction(radians(40.0), 2.0 * pi * (k + 0.5) / azimuths));
      const RgbEstimate estimate = replicates(5 + o, [&](const SamplePoints& points) {
        std::vector<Rgb> values(wi.size());
        surface.sample_row(direction(std::acos(cosines_o[o]), 0.0), wi, points, 512, false, {.values = values});
        Rgb sum;
        for (const Rgb& value : values) sum = sum + value / azimuths;
        return sum;
      });
      std::printf("rough: %.6f +- %.6f, adding-doubling %.6f, distance %.2f\n", estimate.mean(), estimate.error(),
                  exact.azimuthal_mean(0, o).x, estimate.distance(exact.azimuthal_mean(0, o).x));
      EXPECT_LT(std::abs(estimate.distance(exact.azimuthal_mean(0, o).x)), 4.0) << text;
    }
  }
}

TEST(Layered, AddingDoublingIsReciprocalAndConservesEnergy) {
  const std::array cosines{0.2, 0.5, 0.9};
  const AddingDoubling exact(
      stack_of(layers(R"({"interface":{"ior":1.4}},{"medium":{"mean_free_path":1,"albedo":1,"g":0.3,"thickness":2}},
                         {"interface":{"ior":1.7}},{"medium":{"mean_free_path":1,"albedo":1,"g":-0.2,"thickness":1}},
                         {"diffuse":{"albedo":1}})")),
      cosines, cosines);
  for (std::size_t a = 0; a < cosines.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      EXPECT_NEAR(exact.value(a, b, 1.0).x, exact.value(b, a, 1.0).x, 1e-6 * exact.value(a, b, 1.0).x);
    }
    // The mirror images in both interfaces.
    const double first = DielectricFresnel::evaluate(cosines[a], 1.4), inside = refracted_cosine(cosines[a], 1.4);
    const double second = DielectricFresnel::evaluate(inside, 1.7 / 1.4) * std::exp(-4.0 / inside);
    const double mirrored = first + (1.0 - first) * (1.0 - first) * second / (1.0 - first * second);
    EXPECT_NEAR(exact.albedo(a).x + mirrored, 1.0, 1e-6);
  }
}

const std::string rich_stack = layers(
    R"({"interface":{"ior":1.5,"alpha":0.3}},{"medium":{"mean_free_path":1,"albedo":[0.9,0.5,0.7],"g":0.5,"thickness":0.6}},
       {"interface":{"ior":1.3,"alpha":0.2,"bounces":1}},{"medium":{"mean_free_path":2,"albedo":[0.3,0.9,0.7],"thickness":0.6}},
       {"conductor":{"eta":[0.2,0.4,1.4],"k":[3.9,2.5,1.9],"alpha":0.4}})");

// 9 comparisons at 4 standard errors: 0.4 %.
TEST(Layered, EstimatesAreReciprocal) {
  const LayeredSurface surface(stack_of(rich_stack));
  for (const double phi : {10.0, 90.0, 175.0}) {
    const Direction a = direction(radians(25.0), 0.0), b = direction(radians(70.0), radians(phi));
    const RgbEstimate forward = estimate_value(surface, a, b, 2000, 7), back = estimate_value(surface, b, a, 2000, 8);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_LT(std::abs(forward.channel[c].mean - back.channel[c].mean),
                4.0 * std::hypot(forward.channel[c].standard_error, back.channel[c].standard_error));
      EXPECT_LT(forward.channel[c].standard_error, 0.05 * forward.channel[c].mean);
    }
  }
}

bool same(const Rgb& a, const Rgb& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

TEST(Layered, ValuesDependNeitherOnTheLineNorOnThreads) {
  const LayeredSurface surface(stack_of(rich_stack));
  const Direction wo = direction(radians(35.0), 0.2);
  std::vector<Direction> wi;
  for (const double theta : {0.0, 20.0, 60.0, 85.0}) {
    for (int k = 0; k < 5; ++k) wi.push_back(direction(radians(theta), 0.1 + 0.7 * k));
  }
  const SamplePoints points(Sampler::sobol, {1, 2, 3});
  std::vector<Rgb> row(wi.size());
  surface.sample_row(wo, wi, points, 64, true, {.values = row});
  std::vector<Rgb> alone(wi.size());
  tbb::parallel_for(std::size_t{0}, wi.size(),
                    [&](std::size_t j) { alone[j] = one_sample_row(surface, wi[j], wo, points, 64); });
  for (std::size_t j = 0; j < wi.size(); ++j) EXPECT_TRUE(same(row[j], alone[j])) << j;
  // From below the horizon nothing comes.
  EXPECT_TRUE(same(one_sample_row(surface, direction(2.0, 0.0), wo, points, 4), {}));
  EXPECT_TRUE(same(one_sample_row(surface, wo, direction(2.0, 0.0), points, 4), {}));
}

TEST(Layered, ChannelsAndCoverageAreExactMixtures) {
  const Direction wi = direction(radians(40.0), 0.0), wo = direction(radians(20.0), 1.0);
  const SamplePoints points(Sampler::sobol, {1, 2, 3});
  const auto value = [&](const std::string& list) {
    return one_sample_row(LayeredSurface(stack_of(layers(list))), wi, wo, points, 256);
  };
  const std::string coat =
      R"({"interface":{"ior":1.5,"alpha":0.2}},{"medium":{"mean_free_path":[1,2,3],"albedo":[0.9,0.5,0.1],"thickness":0.5}})";
  const std::string haze = R"({"medium":{"mean_free_path":1,"albedo":0.5,"g":0.5,"thickness":0.2}})";
  const std::string bottom = R"({"diffuse":{"albedo":[0.2,0.5,0.8]}})";
  const Rgb colour = value(coat + "," + bottom);
  const Rgb green = value(
      R"({"interface":{"ior":1.5,"alpha":0.2}},{"medium":{"mean_free_path":2,"albedo":0.5,"thickness":0.5}},{"diffuse":{"albedo":0.5}})");
  EXPECT_EQ(colour.y, green.y);
  const Rgb mixed = value(R"({"slab":{"coverage":0.3,"layers":[)" + coat + R"(]}},{"slab":{"coverage":0.6,"layers":[)" +
                          haze + "]}}," + bottom);
  const Rgb expected = value(bottom) * (0.7 * 0.4) + colour * (0.3 * 0.4) + value(haze + "," + bottom) * (0.7 * 0.6) +
                       value(coat + "," + haze + "," + bottom) * (0.3 * 0.6);
  EXPECT_NEAR(mixed.x, expected.x, 1e-14);
  EXPECT_NEAR(mixed.z, expected.z, 1e-14);
  EXPECT_TRUE(same(value(R"({"slab":{"coverage":0,"layers":[)" + coat + "]}}," + bottom), value(bottom)));
  EXPECT_TRUE(same(value(R"({"slab":{"coverage":1,"layers":[)" + coat + "]}}," + bottom), colour));
}

TEST(Layered, ThickWhiteMediaEnd) {
  // Paths of tens of thousands of vertices, over a black bottom: 0.1 % of the light gets there.
  const LayeredSurface surface(
      stack_of(layers(R"({"medium":{"mean_free_path":0.001,"albedo":1,"thickness":1}},{"diffuse":{"albedo":0}})")));
  const Direction wo = direction(radians(30.0), 0.0);
  const Rgb albedo = surface.sample_albedo(wo, SamplePoints(Sampler::sobol, {1, 0, 0}), 1000);
  EXPECT_GT(albedo.x, 0.98);
  EXPECT_LE(albedo.x, 1.0);
  EXPECT_GT(one_sample_row(surface, wo, wo, SamplePoints(Sampler::sobol, {1, 0, 0}), 100).x, 0.2);
}

/// As the reference reads it.
LayerStack read_stack(const std::string& path) {
  const Json json = parse_json(read_file(path), path);
  return LayerStack::from_json(JsonReader(json, path));
}

TEST(Layered, BadStacksAreRefusedWithTheirPath) {
  const std::string bottom = R"(,{"diffuse":{"albedo":0.5}})";
  const auto medium = [&](const std::string& members) { return layers("{\"medium\":{" + members + "}}" + bottom); };
  const auto interface = [&](const std::string& members) {
    return layers("{\"interface\":{" + members + "}}" + bottom);
  };
  const struct {
    std::string text, path, what;
  } cases[] = {
      {"{}", "$", "missing 'layers'"},
      {"[]", "$", "object"},
      {"{\"layers\":[]}", "$.layers", "empty"},
      {"{\"layers\":{}}", "$.layers", "list"},
      {"{\"layers\":[{\"diffuse\":{\"albedo\":0.5}}],\"layer\":1}", "$", "unknown key 'layer'"},
      {layers("{}"), "$.layers[0]", "expected one of"},
      {layers("{\"glass\":{}}"), "$.layers[0]", "unknown key 'glass'"},
      {layers("{\"interface\":{\"ior\":1.5},\"diffuse\":{\"albedo\":1}}"), "$.layers[0]", "expected one of"},
      {layers("{\"diffuse\":{\"albedo\":1}}" + bottom), "$.layers[0]", "below an opaque"},
      {layers("{\"conductor\":{\"f0\":1}}" + bottom), "$.layers[0]", "below an opaque"},
      {layers(R"({"medium":{"mean_free_path":1,"albedo":1,"thickness":1}})"), "$.layers[0]", "no bottom"},
      {layers(R"({"slab":{"coverage":0.5,"layers":[{"interface":{"ior":1.5}}]}})"), "$.layers[0]", "no bottom"},
      {interface(""), "$.layers[0].interface", "missing 'ior'"},
      {interface("\"ior\":0.9"), "$.layers[0].interface.ior", "out of range"},
      {interface("\"ior\":\"1.5\""), "$.layers[0].interface.ior", "number"},
      {interface("\"ior\":1.5,\"alpha\":-0.1"), "$.layers[0].interface.alpha", "out of range"},
      {interface("\"ior\":1.5,\"alpha\":1e-5"), "$.layers[0].interface.alpha", "out of range"},
      {interface("\"ior\":1.5,\"alpha\":1.1"), "$.layers[0].interface.alpha", "out of range"},
      {interface("\"ior\":1.5,\"bounces\":2"), "$.layers[0].interface.bounces", "bounces"},
      {interface("\"ior\":1.5,\"bounces\":\"some\""), "$.layers[0].interface.bounces", "bounces"},
      {interface("\"ior\":1.5,\"rough\":1"), "$.layers[0].interface", "unknown key"},
      {medium(R"("mean_free_path":0,"albedo":1,"thickness":1)"), "$.layers[0].medium.mean_free_path", "positive"},
      {medium(R"("mean_free_path":[1,-1,1],"albedo":1,"thickness":1)"), "$.layers[0].medium.mean_free_path[1]",
       "positive"},
      {medium(R"("mean_free_path":[1,1],"albedo":1,"thickness":1)"), "$.layers[0].medium.mean_free_path", "three"},
      {medium(R"("mean_free_path":1e-300,"albedo":1,"thickness":1e300)"), "$.layers[0].medium", "infinitely"},
      {medium(R"("mean_free_path":1,"albedo":1.1,"thickness":1)"), "$.layers[0].medium.albedo", "out of range"},
      {medium(R"("mean_free_path":1,"albedo":[0,-0.1,0],"thickness":1)"), "$.layers[0].medium.albedo[1]",
       "out of range"},
      {medium(R"("mean_free_path":1,"albedo":1,"thickness":-1)"), "$.layers[0].medium.thickness", "negative"},
      {medium(R"("mean_free_path":1,"albedo":1,"thickness":null)"), "$.layers[0].medium.thickness", "number"},
      {medium(R"("mean_free_path":1,"albedo":1)"), "$.layers[0].medium", "missing 'thickness'"},
      {medium(R"("mean_free_path":1,"albedo":1,"thickness":1,"g":1)"), "$.layers[0].medium.g", "out of range"},
      {medium(R"("mean_free_path":1,"albedo":1,"thickness":1,"g":-1)"), "$.layers[0].medium.g", "out of range"},
      {layers(R"({"slab":{"coverage":1.5,"layers":[{"interface":{"ior":1.5}}]}})" + bottom),
       "$.layers[0].slab.coverage", "out of range"},
      {layers(R"({"slab":{"coverage":0.5,"layers":[]}})" + bottom), "$.layers[0].slab.layers", "empty"},
      {layers(R"({"slab":{"coverage":0.5,"layers":[{"diffuse":{"albedo":1}}]}})" + bottom),
       "$.layers[0].slab.layers[0]", "unknown key"},
      {layers(R"({"conductor":{}})"), "$.layers[0].conductor", "f0"},
      {layers(R"({"conductor":{"f0":1,"k":1}})"), "$.layers[0].conductor", "together"},
      {layers(R"({"conductor":{"eta":1}})"), "$.layers[0].conductor", "missing 'k'"},
      {layers(R"({"conductor":{"eta":0,"k":1}})"), "$.layers[0].conductor.eta", "positive"},
      {layers(R"({"diffuse":{"albedo":2}})"), "$.layers[0].diffuse.albedo", "out of range"},
      {layers(R"({"diffuse":{"albedo":0.5,"alpha":2}})"), "$.layers[0].diffuse.alpha", "out of range"},
  };
  for (const auto& [text, path, what] : cases) {
    try {
      stack_of(text);
      ADD_FAILURE() << "accepted: " << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::invalid_input);
      const std::string message = error.what();
      EXPECT_NE(message.find("(stack, " + path + ")"), std::string::npos) << message;
      EXPECT_NE(message.find(what), std::string::npos) << message;
    }
  }
  // What JSON cannot spell but a program can.
  Json json = parse_json(R"({"layers":[{"diffuse":{"albedo":0.5}}]})", "stack");
  json["layers"][0]["diffuse"]["albedo"] = std::nan("");
  EXPECT_THROW(LayerStack::from_json(JsonReader(json, "stack")), Error);
  std::string nine;
  for (int k = 0; k < 9; ++k) nine += R"({"slab":{"coverage":0.5,"layers":[{"interface":{"ior":1.5}}]}},)";
  EXPECT_THROW(stack_of(layers(nine + R"({"diffuse":{"albedo":1}})")), Error);
  EXPECT_THROW(read_stack("/nonexistent/stack.json"), Error);
}

TEST(Layered, IsAReference) {
  const Reference reference = layered_reference();
  ParameterValues values = reference.defaults();
  EXPECT_THROW(reference.make(values), Error);
  values.set_text("stack", std::string(LOBEFIT_DATA_FOLDER) + "/stacks/worn_coat.json");
  EXPECT_EQ(reference.make(values)->channels(), 3);
}

TEST(Layered, ShippedStacksWork) {
  for (const char* name : {"varnished_paint", "pearl_over_metal", "worn_coat"}) {
    const LayerStack stack = read_stack(std::string(LOBEFIT_DATA_FOLDER) + "/stacks/" + name + ".json");
    const auto surface = make_layered(stack);
    EXPECT_EQ(surface->channels(), 3);
    const RgbEstimate estimate =
        estimate_value(*surface, direction(radians(40.0), 0.0), direction(radians(40.0), 2.0), 256);
    EXPECT_GT(estimate.mean(), 0.0) << name;
  }
}

// Not a test but a measurement: run it by --gtest_also_run_disabled_tests --gtest_filter='*Table*'.
TEST(Layered, DISABLED_TableOf24Cubed) {
  const struct {
    const char* name;
    std::uint32_t samples;  // of a replicate
    std::string text;
  } cases[] = {
      {"smooth coat, scattering medium, Lambert", 80,
       layers(
           R"({"interface":{"ior":1.5}},{"medium":{"mean_free_path":1,"albedo":0.9,"g":0.5,"thickness":1}},{"diffuse":{"albedo":0.8}})")},
      {"rough coat (0.1, one bounce), scattering medium, Lambert", 120,
       layers(
           R"({"interface":{"ior":1.5,"alpha":0.1,"bounces":1}},{"medium":{"mean_free_path":1,"albedo":0.9,"g":0.5,"thickness":1}},{"diffuse":{"albedo":0.8}})")},
      {"rough coat (0.1, all bounces), scattering medium, Lambert", 120,
       layers(
           R"({"interface":{"ior":1.5,"alpha":0.1}},{"medium":{"mean_free_path":1,"albedo":0.9,"g":0.5,"thickness":1}},{"diffuse":{"albedo":0.8}})")},
      {"two rough interfaces, two media, rough conductor, RGB", 240, rich_stack}};
  for (const auto& [name, samples, text] : cases) {
    const LayeredSurface surface(stack_of(text));
    std::vector<Direction> wi;
    for (int i = 0; i < 24; ++i) {
      for (int k = 0; k < 24; ++k) wi.push_back(direction(radians((i + 0.5) * 3.75), radians(k * 180.0 / 23.0)));
    }
    std::vector<double> errors(24 * wi.size());
    const auto begin = std::chrono::steady_clock::now();
    const std::clock_t cpu = std::clock();
    tbb::parallel_for(std::uint32_t{0}, std::uint32_t{24}, [&](std::uint32_t line) {
      const Direction wo = direction(radians((line + 0.5) * 3.75), 0.0);
      std::vector<Rgb> values(wi.size() * replicate_count);
      for (std::uint32_t r = 0; r < replicate_count; ++r) {
        surface.sample_row(wo, wi, SamplePoints(Sampler::sobol, {1, line, r}), samples, true,
                           {.values = std::span(values).subspan(r * wi.size(), wi.size())});
      }
      for (std::size_t j = 0; j < wi.size(); ++j) {
        std::array<double, replicate_count> column;
        for (std::size_t r = 0; r < replicate_count; ++r) column[r] = values[r * wi.size() + j].x;
        const MeanAndError result = mean_and_error(std::span<const double>(column));
        errors[line * wi.size() + j] = result.standard_error / result.mean;
      }
    });
    const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const double seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
    std::sort(errors.begin(), errors.end());
    const auto quantile = [&](double q) { return 100.0 * errors[static_cast<std::size_t>(q * 13823.0)]; };
    std::printf(
        "%s: %u samples, %.1f s wall, %.1f s CPU, relative error median %.2f %%, 90 %% %.2f %%, largest %.1f %%\n",
        name, samples * replicate_count, wall, seconds, quantile(0.5), quantile(0.9), quantile(1.0));
  }
}

}  // namespace
}  // namespace lobefit
