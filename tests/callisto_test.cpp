// Callisto in the slides' form and in the port's.

#include <gtest/gtest.h>

#include <cmath>

#include "models/callisto/ue427.h"
#include "models/registry.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

using Settings = std::initializer_list<std::pair<std::string_view, std::vector<double>>>;

ParameterValues with(std::string_view name, Settings settings) {
  ParameterValues values = find_model(name).defaults();
  for (const auto& [parameter, components] : settings) values.set(parameter, std::span(components));
  return values;
}
Rgb value(const ParameterValues& values, const Direction& wi, const Direction& wo) {
  return find_model(values.owner()).evaluate(values.flat(), wi, wo);
}
void expect_near(const Rgb& found, const Rgb& truth, double tolerance) {
  EXPECT_NEAR(found.x, truth.x, tolerance);
  EXPECT_NEAR(found.y, truth.y, tolerance);
  EXPECT_NEAR(found.z, truth.z, tolerance);
}

// ---- values -----------------------------------------------------------------------------------------------------

// By mpmath at 40 digits from the formulas as the slides print them: θ_d and θ_h by arc cosines, h, c1, c2 with the
// smoothstep's own definition, D in its textbook form, Smith's Λ, and the second lobe by its roughness sat(r s).
const Settings everything_on{{"albedo", {0.5, 0.25, 0.75}},
                             {"diffuse_fresnel", {3.0}},
                             {"diffuse_fresnel_falloff", {0.625}},
                             {"diffuse_fresnel_tangent_falloff", {0.875}},
                             {"diffuse_fresnel_tint", {1.0, 0.5, 0.25}},
                             {"retroreflection", {5.0}},
                             {"retroreflection_falloff", {0.875}},
                             {"retroreflection_tangent_falloff", {0.625}},
                             {"retroreflection_tint", {0.25, 0.5, 1.0}},
                             {"terminator_tint", {1.0, 0.5, 0.25}},
                             {"terminator_length", {1.0}},
                             {"f0", {0.0625, 0.125, 0.25}},
                             {"specular_fresnel_falloff", {0.75}}};
const Direction value_wi = direction(radians(60.0), 0.0), value_wo = direction(radians(40.0), radians(140.0));

TEST(Callisto, ValuesOfTheSlides) {
  ParameterValues p = with("callisto", everything_on);
  p.set("alpha", 0.25);
  p.set("terminator", 0.75);
  p.set("dual_specular_roughness_scale", 1.5);
  p.set("dual_specular_opacity", 0.375);
  expect_near(value(p, value_wi, value_wo), {0.12302872526731434, 0.10391017141091173, 0.29246487948903206}, 1e-15);
  p.set_text("dual_specular", "add");
  expect_near(value(p, value_wi, value_wo), {0.13035831814887770, 0.11808905358050794, 0.31896517162183302}, 1e-15);
}

TEST(Callisto, ValuesOnLambert) {
  ParameterValues p = with("callisto_lambert", everything_on);
  p.set("alpha", 0.25);
  p.set("terminator", -0.5);
  p.set("dual_specular_roughness_scale", 1.5);
  p.set("dual_specular_opacity", 0.375);
  expect_near(value(p, value_wi, value_wo), {0.23872206382216480, 0.14331373029709428, 0.34762185145992382}, 1e-15);
}

TEST(Callisto, ValuesOfThePort) {
  ParameterValues p = with("callisto_ue427", everything_on);
  p.set("roughness", 0.5);
  expect_near(value(p, value_wi, value_wo), {0.11078487400523667, 0.097885983364057528, 0.28063929432499961}, 1e-15);
}

// ---- neutral and limiting parameters ----------------------------------------------------------------------------

TEST(Callisto, NeutralParametersLeaveTheBaseline) {
  for (const double alpha : {0.01, 0.3, 1.0}) {
    const ParameterValues proxima = with("proxima", {{"albedo", {0.7}}, {"alpha", {alpha}}});
    const ParameterValues lambert = with("lambert", {{"albedo", {0.7}}});
    const ParameterValues ggx = with("specular_ggx", {{"alpha", {alpha}}, {"f0", {0.04}}});
    const ParameterValues callisto = with("callisto", {{"albedo", {0.7}}, {"alpha", {alpha}}});
    const ParameterValues on_lambert = with("callisto_lambert", {{"albedo", {0.7}}, {"alpha", {alpha}}});
    const ParameterValues port =
        with("callisto_ue427", {{"albedo", {0.7}}, {"roughness", {std::sqrt(alpha)}}, {"terminator_tint", {0.0}}});
    for (const auto& [wi, wo] : random_pairs(300, 21)) {
      const double specular = value(ggx, wi, wo).x;
      const double with_proxima = value(proxima, wi, wo).x + specular;
      EXPECT_NEAR(value(callisto, wi, wo).x, with_proxima, 1e-12 * with_proxima);
      EXPECT_NEAR(value(port, wi, wo).x, with_proxima, 1e-12 * with_proxima);
      const double with_lambert = value(lambert, wi, wo).x + specular;
      EXPECT_NEAR(value(on_lambert, wi, wo).x, with_lambert, 1e-12 * with_lambert);
    }
  }
}

TEST(Callisto, IntensitiesAreReachedWhereTheyPeak) {
  // Without specular, f π is c1. Light and view grazing from opposite sides: θ_d = 90°, θ_h = 0. From the same side:
  // θ_d = 0, θ_h = 90°. Both at the normal: neither.
  const ParameterValues p = with(
      "callisto_lambert",
      {{"f0", {0.0}}, {"specular_fresnel_falloff", {0.0}}, {"diffuse_fresnel", {7.0}}, {"retroreflection", {0.25}}});
  const Direction grazing = direction(radians(90.0 - 1e-7), 0.0), opposite = direction(radians(90.0 - 1e-7), pi);
  EXPECT_NEAR(pi * value(p, grazing, opposite).x, 7.0, 1e-6);
  EXPECT_NEAR(pi * value(p, grazing, grazing).x, 0.25, 1e-6);
  EXPECT_DOUBLE_EQ(pi * value(p, {0.0, 0.0, 1.0}, {0.0, 0.0, 1.0}).x, 1.0);
}

TEST(Callisto, LargestFalloffsReachEverywhere) {
  // r(1) = 0: both exponents vanish, and c1 = ρ_f ρ_r.
  const ParameterValues p = with("callisto_lambert", {{"f0", {0.0}},
                                                      {"specular_fresnel_falloff", {0.0}},
                                                      {"diffuse_fresnel", {3.0}},
                                                      {"diffuse_fresnel_falloff", {1.0}},
                                                      {"diffuse_fresnel_tangent_falloff", {1.0}},
                                                      {"retroreflection", {0.5}},
                                                      {"retroreflection_falloff", {1.0}},
                                                      {"retroreflection_tangent_falloff", {1.0}}});
  for (const auto& [wi, wo] : random_pairs(100, 22)) EXPECT_DOUBLE_EQ(pi * value(p, wi, wo).x, 1.5);
}

TEST(Callisto, SpecularFresnelFalloff) {
  for (const auto& [wi, wo] : random_pairs(100, 23)) {
    const auto specular = [&](double falloff) {
      return value(
                 with("callisto_lambert", {{"albedo", {0.0}}, {"f0", {0.1}}, {"specular_fresnel_falloff", {falloff}}}),
                 wi, wo)
          .x;
    };
    const auto ggx = [&](double f0, double f90) {
      return value(with("specular_ggx", {{"f0", {f0}}, {"f90", {f90}}}), wi, wo).x;
    };
    EXPECT_NEAR(specular(0.0), ggx(0.1, 0.1), 1e-12);
    EXPECT_NEAR(specular(0.5), ggx(0.1, 1.0), 1e-12);
    EXPECT_NEAR(specular(1.0), ggx(1.0, 1.0), 1e-12);
  }
}

TEST(Callisto, DualLobes) {
  for (const auto& [wi, wo] : random_pairs(200, 24)) {
    const auto specular = [&](double scale, double opacity, const char* choice) {
      ParameterValues p = with("callisto_lambert", {{"albedo", {0.0}},
                                                    {"alpha", {0.16}},
                                                    {"dual_specular_roughness_scale", {scale}},
                                                    {"dual_specular_opacity", {opacity}}});
      p.set_text("dual_specular", choice);
      return value(p, wi, wo).x;
    };
    const auto ggx = [&](double alpha) { return value(with("specular_ggx", {{"alpha", {alpha}}}), wi, wo).x; };
    // Roughness .4 × 1.5 = .6; × 4 is clamped to 1.
    EXPECT_NEAR(specular(1.5, 1.0, "mix"), ggx(0.36), 1e-12);
    EXPECT_NEAR(specular(4.0, 1.0, "mix"), ggx(1.0), 1e-12);
    EXPECT_NEAR(specular(1.0, 0.7, "mix"), ggx(0.16), 1e-12 * ggx(0.16));
    EXPECT_NEAR(specular(1.0, 0.7, "add"), 1.7 * ggx(0.16), 1e-12 * ggx(0.16));
    EXPECT_NEAR(specular(1.5, 0.25, "mix"), 0.75 * ggx(0.16) + 0.25 * ggx(0.36), 1e-12 * (1.0 + ggx(0.16)));
    EXPECT_NEAR(specular(1.5, 0.25, "add"), ggx(0.16) + 0.25 * ggx(0.36), 1e-12 * (1.0 + ggx(0.16)));
  }
}

// ---- the terminator ---------------------------------------------------------------------------------------------

TEST(Callisto, TerminatorDarkensUpToItsEdge) {
  // c2 = f/f(o = 0). View at the normal, light at θ: θ_d = θ_h = θ/2, α_s = (1 - (1 - cos θ/2)³)².
  const auto c2 = [](double theta, double terminator, double length) {
    const Direction wi = direction(theta, 0.3), wo{0.0, 0.0, 1.0};
    const ParameterValues off = with("callisto", {{"terminator", {0.0}}});
    const ParameterValues on = with("callisto", {{"terminator", {terminator}}, {"terminator_length", {length}}});
    return value(on, wi, wo).x / value(off, wi, wo).x;
  };
  for (const double theta : {0.2, 0.8, 1.2, 1.5, 1.57}) {
    const double mask = std::pow(1.0 - std::pow(1.0 - std::cos(0.5 * theta), 3.0), 2.0);
    for (const double length : {0.2, 0.6, 1.0}) {
      const double x = std::min(std::cos(theta) / (mask * length), 1.0), step = x * x * (3.0 - 2.0 * x);
      for (const double terminator : {-1.0, 0.5, 1.0}) {
        EXPECT_NEAR(c2(theta, terminator, length), 1.0 + mask * terminator * (step - 1.0), 1e-12);
      }
    }
    EXPECT_EQ(c2(theta, 1.0, 0.0), 1.0);
  }
}

// ---- laws that differ between the slides and the port -------------------------------------------------------------

double worst_asymmetry(const ParameterValues& p) {
  double worst = 0.0;
  for (const auto& [wi, wo] : random_pairs(500, 25)) {
    const double there = value(p, wi, wo).x, back = value(p, wo, wi).x;
    worst = std::max(worst, std::abs(there - back) / std::max(there, back));
  }
  return worst;
}

TEST(Callisto, C1IsReciprocalInTheSlidesAlone) {
  const Settings uneven{{"diffuse_fresnel", {3.0}}, {"retroreflection", {0.5}}, {"retroreflection_falloff", {0.5}}};
  EXPECT_LT(worst_asymmetry(with("callisto_lambert", uneven)), 1e-13);
  ParameterValues terminated = with("callisto_lambert", uneven);
  terminated.set("terminator", 0.5);
  EXPECT_GT(worst_asymmetry(terminated), 0.1);

  // At roughness 0 Proxima is Lambert, and nothing but c1 is left of the port.
  const Settings lambert{{"roughness", {0.0}}, {"terminator_tint", {0.0}}, {"f0", {0.0}}};
  ParameterValues port = with("callisto_ue427", lambert);
  for (const auto& [name, number] : uneven) port.set(name, std::span(number));
  EXPECT_GT(worst_asymmetry(port), 0.1);
  ParameterValues even = with("callisto_ue427", lambert);
  even.set("diffuse_fresnel", 3.0);
  even.set("retroreflection", 3.0);
  EXPECT_LT(worst_asymmetry(even), 1e-13);
}

TEST(Callisto, ThePortsFresnelPeaksInAnotherPlace) {
  // View at the normal, light at 89°: θ_d is 44.5°, and the slides' Fresnel hardly sets in. The port's is all there.
  const Direction wi = direction(radians(89.0), 0.0), wo{0.0, 0.0, 1.0};
  const Settings settings{{"diffuse_fresnel", {9.0}}, {"f0", {0.0}}, {"specular_fresnel_falloff", {0.0}}};
  const double slides = pi * value(with("callisto_lambert", settings), wi, wo).x;
  ParameterValues port = with("callisto_ue427", settings);
  port.set("roughness", 0.0);
  port.set("terminator_tint", 0.0);
  // h = (1 - cos θ)^2.5 cos^2.5 φ
  EXPECT_NEAR(slides, 1.0 + 8.0 * std::pow(1.0 - std::cos(radians(44.5)), 2.5) * std::pow(std::cos(radians(44.5)), 2.5),
              1e-12);
  EXPECT_LT(slides, 1.2);
  EXPECT_NEAR(pi * value(port, wi, wo).x, 1.0 + 8.0 * std::pow(1.0 - std::cos(radians(89.0)), 2.5), 1e-12);
  EXPECT_GT(pi * value(port, wi, wo).x, 8.0);
}

TEST(Callisto, TiersAreTheSlides) {
  const auto tier = [](const char* model, const char* name) { return find_model(model).defaults().info(name).tier; };
  for (const char* name :
       {"diffuse_fresnel", "retroreflection", "diffuse_fresnel_falloff", "retroreflection_falloff", "terminator"}) {
    EXPECT_EQ(tier("callisto", name), Tier::base) << name;
  }
  for (const char* name : {"diffuse_fresnel_tint", "retroreflection_tint", "terminator_tint",
                           "specular_fresnel_falloff", "dual_specular_roughness_scale", "dual_specular_opacity"}) {
    EXPECT_EQ(tier("callisto", name), Tier::advanced) << name;
  }
  for (const char* name : {"diffuse_fresnel_tangent_falloff", "retroreflection_tangent_falloff", "terminator_length"}) {
    EXPECT_EQ(tier("callisto", name), Tier::full) << name;
  }
}

}  // namespace
}  // namespace lobefit
