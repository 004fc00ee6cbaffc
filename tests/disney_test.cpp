// Disney's principled BRDF: against its 2012 definition worked out apart from the text, and against the terms that are
// left where its parameters are neutral.
#include <gtest/gtest.h>

#include <cmath>
#include <string_view>

#include "fit/dual.h"
#include "models/disney/principled.h"
#include "tests/model_values.h"
#include "tests/sphere_sampling.h"

namespace lobefit {
namespace {

void expect_rgb(const Rgb& found, const Rgb& expected, double relative) {
  EXPECT_NEAR(found.x, expected.x, relative * std::abs(expected.x));
  EXPECT_NEAR(found.y, expected.y, relative * std::abs(expected.y));
  EXPECT_NEAR(found.z, expected.z, relative * std::abs(expected.z));
}

Direction at(double theta, double phi) { return direction(radians(theta), radians(phi)); }

TEST(Disney, Values) {
  // The code of S4 in 30-digit arithmetic (mpmath), from the angles: base colour .8 .5 .2 through the power 2.2,
  // luminance .3 .6 .1, both lobes with their printed denominators, GTR1 as (a² - 1)/(π ln a² (1 + (a² - 1) cos²)),
  // a = lerp(.1, .001, .3) = .0703.
  const Material disney = Material("disney", {{"metallic", 0.3},
                                              {"roughness", 0.4},
                                              {"specular", 0.6},
                                              {"specular_tint", 0.7},
                                              {"anisotropic", 0.5},
                                              {"subsurface", 0.4},
                                              {"sheen", 0.8},
                                              {"sheen_tint", 0.6},
                                              {"clearcoat", 0.9},
                                              {"clearcoat_gloss", 0.3}})
                              .color("base_color", {0.8, 0.5, 0.2});
  // The tint's 1e-12 is felt at 1e-12 of the value, no more.
  expect_rgb(disney(at(30, 25), at(60, 115)), {0.1351279639065306, 0.0486742969473725815, 0.00732535766144498611},
             1e-11);
  expect_rgb(disney(at(60, 25), at(60, 205)), {3.43087195271168495, 1.64663513793961089, 0.793272842033986223}, 1e-11);
  expect_rgb(disney(at(80, 25), at(20, 155)), {0.148905388483673413, 0.0550391649671445597, 0.0101449584667097199},
             1e-11);
}

TEST(Disney, NeutralParametersLeaveTheTerms) {
  // No specular: what is left of the lobe is Schlick's grazing part over F0 = 0, by the registered terms.
  const double base = 0.6, linear = std::pow(base, 2.2);
  for (const double roughness : {0.1, 0.5, 1.0}) {
    const double alpha = roughness * roughness;
    const Material burley("burley", {{"albedo", linear}, {"roughness", roughness}});
    const Material subsurface("disney_subsurface", {{"albedo", linear}, {"roughness", roughness}});
    const Material d("d_ggx", {{"alpha", alpha}});
    const Material masking("g_smith_ggx", {{"alpha", alpha}});
    const Material coat_d("d_gtr1", {{"alpha", 0.1}});
    const Material coat_masking("g_smith_ggx", {{"alpha", 0.25}});
    for (const auto& [wi, wo] : random_pairs(200, 92)) {
      const auto lobe = [&](double f0, const Material& density, const Material& shadowing) {
        const Material fresnel("f_schlick", {{"f0", f0}});
        return density(wi, wo).x * shadowing(wi, wo).x * fresnel(wi, wo).x / (4.0 * wi.z * wo.z);
      };
      const auto disney = [&](Parameters parameters) {
        const Model& model = find_model("disney");
        ParameterValues values = model.defaults();
        values.set("roughness", roughness);
        values.set("base_color", base);
        values.set("specular", 0.0);
        for (const auto& [name, value] : parameters) values.set(name, value);
        return model.evaluate(values.flat(), wi, wo).x;
      };
      const double gloss = lobe(0.0, d, masking);
      const double grazing = Material("f_schlick", {{"f0", 0.0}})(wi, wo).x;
      const auto near = [&](double found, double expected) { EXPECT_NEAR(found, expected, 1e-11 * expected); };
      // Metallic, subsurface, sheen, clearcoat at 0: Burley and the lobe.
      near(disney({}), burley(wi, wo).x + gloss);
      near(disney({{"subsurface", 1.0}}), subsurface(wi, wo).x + gloss);
      near(disney({{"specular", 1.0}}), burley(wi, wo).x + lobe(0.08, d, masking));
      near(disney({{"metallic", 1.0}}), lobe(linear, d, masking));
      near(disney({{"metallic", 1.0}, {"sheen", 1.0}, {"subsurface", 0.5}}), lobe(linear, d, masking));
      near(disney({{"sheen", 1.0}}), burley(wi, wo).x + gloss + grazing);
      // A grey's tint is white.
      near(disney({{"sheen", 1.0}, {"sheen_tint", 1.0}, {"specular_tint", 1.0}}), burley(wi, wo).x + gloss + grazing);
      near(disney({{"clearcoat", 1.0}, {"clearcoat_gloss", 0.0}}),
           burley(wi, wo).x + gloss + 0.25 * lobe(0.04, coat_d, coat_masking));
    }
  }
}

TEST(Disney, AnisotropyIsTheTermOfItsAlphas) {
  // anisotropic 1: aspect √.1.
  const double aspect = std::sqrt(0.1), alpha = 0.25;
  const Material disney("disney", {{"roughness", 0.5}, {"anisotropic", 1.0}, {"metallic", 1.0}, {"base_color", 1.0}});
  const Material d("d_ggx_anisotropic", {{"alpha_x", alpha / aspect}, {"alpha_y", alpha * aspect}});
  const auto g1 = [&](const Direction& w) {
    const double a2 = square(alpha / aspect) * w.x * w.x + square(alpha * aspect) * w.y * w.y;
    return 2.0 / (1.0 + std::sqrt(1.0 + a2 / (w.z * w.z)));
  };
  for (const auto& [wi, wo] : random_pairs(200, 93)) {
    const double expected = d(wi, wo).x * g1(wi) * g1(wo) / (4.0 * wi.z * wo.z);
    EXPECT_NEAR(disney(wi, wo).x, expected, 1e-11 * expected);
  }
}

TEST(Disney, TintIsContinuousAtBlack) {
  const Direction wi = at(50, 10), wo = at(60, 170);
  const auto value = [&](double c) {
    return Material("disney", {{"specular_tint", 1.0}, {"specular", 1.0}}).color("base_color", {0.0, 0.0, c})(wi, wo).z;
  };
  const double black = value(0.0), step = value(1e-8) - black;
  EXPECT_LT(std::abs(step), 1e-3 * black);
  // Deep blue has ten times a grey's reflectance, as printed: 1/.1.
  EXPECT_GT(value(0.05), 5.0 * black);
  // The steepest slope on the way: finite, and found by the derivatives too.
  const auto dual = [&](double c) {
    Disney::Parameters<Dual<1>> p{};
    p.base_color.z = Dual<1>::variable(c, 0);
    p.specular = p.specular_tint = 1.0;
    p.roughness = 0.5;
    return evaluate_brdf<Disney>(p, wi, wo).z.derivative[0];
  };
  for (const double c : {0.0, 1e-12, 1e-8, 1e-6, 1e-5, 1e-3, 0.1}) {
    EXPECT_TRUE(std::isfinite(dual(c))) << c;
    EXPECT_LT(std::abs(dual(c)), 1e6) << c;
  }
}

TEST(Disney, SamplesFollowTheirPdf) {
  const Material rough("disney", {{"roughness", 0.6}, {"anisotropic", 0.4}, {"sheen", 0.5}});
  for (const double theta : {0.0, 50.0, 80.0}) expect_samples_follow_pdf(rough.model(), rough.flat(), at(theta, 20.0));
  // Clear coat of alpha .1: facets that face away from the view reflect nothing.
  const Material coated("disney", {{"roughness", 0.6}, {"clearcoat", 1.0}, {"clearcoat_gloss", 0.0}});
  expect_samples_follow_pdf(coated.model(), coated.flat(), at(50.0, 20.0), 0.02);
  EXPECT_NEAR(sampled_albedo(coated.model(), coated.flat(), at(50.0, 20.0), 300),
              integrated_albedo(coated.model(), coated.flat(), at(50.0, 20.0)), 1e-3);
}

TEST(Disney, SharpCoatsAreSampledToo) {
  // alpha .001: the lobe's own energy, .25 E with F and G nearly constant over it; at the normal .25 × .04 × G1² of
  // cos θ = 1, which is 1.
  const Material coated("disney", {{"base_color", 0.0}, {"specular", 0.0}, {"clearcoat", 1.0}});
  const Material bare("disney", {{"base_color", 0.0}, {"specular", 0.0}});
  const Direction normal{0.0, 0.0, 1.0};
  const double coat = sampled_albedo(coated.model(), coated.flat(), normal, 400) -
                      sampled_albedo(bare.model(), bare.flat(), normal, 400);
  // GTR1 has a long tail even so: a tenth of its facets are beyond 30°.
  EXPECT_NEAR(coat, 0.01, 0.002);
  std::printf("clear coat at the normal: albedo %.5f\n", coat);
}

}  // namespace
}  // namespace lobefit
