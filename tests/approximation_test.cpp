// Closed forms and the exact functions that they stand for, and recipes of them.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "evaluate/form_shader.h"
#include "evaluate/shader.h"
#include "fit/approximation_recipe.h"
#include "fit/recipe.h"
#include "models/energy/ggx_albedo.h"
#include "models/microfacet/masking.h"
#include "reference/hair/scattering.h"
#include "reference/output_file.h"
#include "tests/gauss_legendre.h"
#include "tests/shader_compiler.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

double target(const std::string& name, std::vector<double> arguments) { return find_target(name).evaluate(arguments); }
double published(const std::string& name, std::vector<double> arguments) {
  const Form& form = find_form(name);
  return form.evaluate(form.published(), arguments, nullptr);
}

// ---- targets
// ---------------------------------------------------------------------------------------------------------

// G1 from its definition: cosθ over the area that facets show to it, ∫ (w·m)⁺ D dm.
TEST(Targets, SmithMaskingIsTheShareOfVisibleArea) {
  const auto g1 = [](double mu, const std::function<double(double)>& distribution) {
    const double sine = std::sqrt(1.0 - mu * mu);
    double area = 0.0;
    for (const QuadraturePoint& t : gauss_legendre(400, 0.0, 0.5 * pi)) {
      const double d = distribution(t.x) * std::sin(t.x);
      for (const QuadraturePoint& phi : gauss_legendre(100, 0.0, pi)) {
        const double cosine = sine * std::sin(t.x) * std::cos(phi.x) + mu * std::cos(t.x);
        if (cosine > 0.0) area += 2.0 * t.weight * phi.weight * cosine * d;
      }
    }
    return mu / area;
  };
  for (const double alpha : {0.3, 0.7}) {
    const auto ggx = [&](double theta) {
      const double c = std::cos(theta), t = c * c * (alpha * alpha - 1.0) + 1.0;
      return alpha * alpha / (pi * t * t);
    };
    const auto beckmann = [&](double theta) {
      const double tangent = std::tan(theta) / alpha;
      return std::exp(-tangent * tangent) / (pi * alpha * alpha * std::pow(std::cos(theta), 4.0));
    };
    for (const double mu : {0.1, 0.4, 0.9}) {
      EXPECT_NEAR(target("smith_ggx_g1", {mu, alpha}), g1(mu, ggx), 2e-4) << alpha << " " << mu;
      EXPECT_NEAR(target("smith_beckmann_g1", {mu, alpha}), g1(mu, beckmann), 2e-4) << alpha << " " << mu;
      EXPECT_NEAR(target("smith_beckmann_cotangent", {mu / (alpha * std::sqrt(1.0 - mu * mu))}),
                  target("smith_beckmann_g1", {mu, alpha}), 1e-14);
    }
  }
}

// The ray at the offset leaves at the azimuth: Φ(1, h) = φ.
TEST(Targets, TtOffsetIsWhereTheRayEnters) {
  for (const double inverse : {0.35, 0.5, 0.645}) {
    for (const double degrees : {120.0, 150.0, 175.0}) {
      const double h = target("hair_tt_offset", {std::cos(degrees * pi / 180.0), inverse});
      const double phi = 2.0 * std::asin(h * inverse) - 2.0 * std::asin(h) + pi;
      EXPECT_NEAR(std::abs(std::remainder(phi, 2.0 * pi)), degrees * pi / 180.0, 1e-12) << inverse << " " << degrees;
    }
  }
}

TEST(Targets, AlbedosMeetTheTablesAndTheSplitAddsUp) {
  for (const double mu : {0.1, 0.5, 1.0}) {
    for (const double alpha : {0.1, 0.5, 1.0}) {
      EXPECT_NEAR(target("ggx_albedo", {mu, alpha}), 1.0 - GgxAlbedoLoss::evaluate(mu, alpha), 5e-4);
      EXPECT_NEAR(target("ggx_albedo", {mu, alpha}),
                  target("ggx_f0_weight", {mu, alpha}) + target("ggx_f90_weight", {mu, alpha}), 1e-7);
    }
  }
  // At alpha = 1 Schlick's k = 1/2 is Smith's own, so that the form by quadrature is the target.
  EXPECT_NEAR(published("ggx_albedo_with_schlick_k", {0.6, 1.0}), target("ggx_albedo_uncorrelated", {0.6, 1.0}), 2e-3);
  EXPECT_NEAR(target("ggx_average_loss", {0.5}), GgxAverageLoss::evaluate(0.5), 1e-4);
}

// ---- forms
// -----------------------------------------------------------------------------------------------------------

// What models compute with published constants is what forms do.
TEST(Forms, ArePartsOfTheModels) {
  for (const double mu : {0.05, 0.3, 0.8}) {
    for (const double alpha : {0.1, 0.45, 0.9}) {
      EXPECT_NEAR(published("schlick_masking", {mu, alpha}), SchlickG1::evaluate(mu, 0.5 * alpha), 1e-15);
      const double sine = std::sqrt(1.0 - mu * mu);
      EXPECT_NEAR(published("beckmann_rational", {mu / (alpha * sine)}), SmithBeckmannG1::evaluate(mu, sine, alpha),
                  1e-14);
      EXPECT_NEAR(published("joint_visibility", {mu, 0.7, alpha}), SmithJointApproximation::evaluate(mu, 0.7, alpha),
                  1e-12);
    }
  }
}

TEST(Forms, DerivativesAreThoseOfDifferences) {
  for (const Form& form : forms()) {
    if (!form.has_shader) continue;
    std::vector<double> constants, arguments(form.arguments.size(), 0.37);
    for (const FormConstant& constant : form.constants) constants.push_back(constant.initial + 0.01);
    std::vector<double> derivatives(constants.size());
    form.evaluate(constants, arguments, derivatives.data());
    for (std::size_t k = 0; k < constants.size(); ++k) {
      std::vector<double> above = constants, below = constants;
      const double step = 1e-6 * std::max(1.0, std::abs(constants[k]));
      above[k] += step;
      below[k] -= step;
      const double slope =
          (form.evaluate(above, arguments, nullptr) - form.evaluate(below, arguments, nullptr)) / (2.0 * step);
      EXPECT_NEAR(derivatives[k], slope, 1e-5 * std::max(1.0, std::abs(slope))) << form.name << " " << k;
    }
  }
}

TEST(Forms, VonMisesIntegratesToItsWeight) {
  const Form& form = find_form("von_mises");
  for (const double kappa : {-4.0, 0.5, 17.0}) {
    double sum = 0.0;
    for (int i = 0; i < 1000; ++i) {
      const std::vector<double> x{std::cos(2.0 * pi * i / 1000.0)};
      sum += form.evaluate(std::vector{kappa, 0.75}, x, nullptr) * 2.0 * pi / 1000.0;
    }
    EXPECT_NEAR(sum, 0.75, 1e-6) << kappa;  // the Bessel polynomial's own error
  }
}

TEST(Forms, ShadersCompileInAsciiAndCount) {
  for (const Form& form : forms()) {
    if (!form.has_shader) continue;
    const std::vector<double> constants = form.published();
    EXPECT_GT(form_operations(form.name, constants).total(), 0) << form.name;
    for (const std::string& language : shader_languages()) {
      const std::string text = form_shader(form.name, language, constants, {});
      EXPECT_TRUE(std::all_of(text.begin(), text.end(), [](char c) { return c > 0; })) << form.name;
      if ((language != "glsl" && language != "hlsl") || !has_shader_compiler(language)) continue;
      std::string call = "Lobefit_" + std::string(form.name) + "(";
      for (std::size_t i = 0; i < form.arguments.size(); ++i) call += i == 0 ? "0.5" : ", 0.5";
      const std::string vector = language == "glsl" ? "vec3" : "float3";
      EXPECT_EQ(shader_complaint(language, text, vector + "(" + call + "))", "form"), "") << form.name;
    }
  }
}

// ---- recipes
// ---------------------------------------------------------------------------------------------------------

class Recipes : public ::testing::Test {
 protected:
  // ctest runs tests beside each other: to each its own folder.
  Recipes()
      : folder_(::testing::TempDir() + "lobefit_approximations_" +
                ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    fs::create_directories(folder_);
  }
  ~Recipes() override { fs::remove_all(folder_); }

  ApproximationRecipe recipe(const std::string& rows) {
    const std::string path = (folder_ / "recipe.json").string();
    std::ofstream(path) << R"({"recipe":"test","kind":"approximations","title":"t","description":"d","rows":[)" << rows
                        << "]}";
    return ApproximationRecipe::read(path);
  }
  std::vector<ApproximationFit> fits(const std::string& rows) {
    recipe_ = recipe(rows);
    Monitor monitor;
    return run_approximations(recipe_, monitor).fits;
  }
  void expect_refused(const std::string& rows, const std::string& path, const std::string& what) {
    try {
      recipe(rows);
      ADD_FAILURE() << "accepted " << rows;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::invalid_input) << error.what();
      EXPECT_NE(std::string(error.what()).find(path), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  }

  ApproximationRecipe recipe_;
  fs::path folder_;
};

// S3's claim, and formulas.md's probe: .675 % at 45 degrees.
TEST_F(Recipes, HairsIndexKeepsItsClaim) {
  const auto result = fits(R"({"name":"a","form":"hair_modified_index","target":"bravais_index","set":{"ior":1.55},
      "domain":{"cos_theta_d":{"from":0,"to":89,"count":90,"as":"cosine_of_degrees"}},"norm":"max","free":["c1","c2"],
      "published":{"c1":"1.19","c2":"0.36"},
      "other_domains":{"to 80 degrees":{"cos_theta_d":{"from":0,"to":80,"count":81,"as":"cosine_of_degrees"}}}})");
  ASSERT_EQ(result.size(), 1u);
  EXPECT_NEAR(result[0].published.max, 0.00675, 5e-6);
  EXPECT_LT(result[0].refit.max, 0.7 * result[0].published.max);
  EXPECT_TRUE(result[0].readings[0].meets_published);
  EXPECT_EQ(result[0].readings[0].domain, "to 80 degrees");
}

// The least largest error alternates: two constants, three extremes of one size (Chebyshev).
TEST_F(Recipes, LargestErrorsAreLevelled) {
  const auto result = fits(R"({"name":"a","form":"hair_modified_index","target":"bravais_index","set":{"ior":1.4},
      "domain":{"cos_theta_d":{"from":0,"to":89,"count":179,"as":"cosine_of_degrees"}},"norm":"max","free":["c1","c2"]})");
  const std::vector<double> constants = result[0].values();
  std::vector<double> extremes;
  double last = 0.0;
  for (int i = 0; i <= 178; ++i) {
    const double c = std::cos(0.5 * i * pi / 180.0), truth = target("bravais_index", {c, 1.4});
    const double error = (constants[0] / c + constants[1] * c) / truth - 1.0;
    if (extremes.empty() || error * last < 0.0) extremes.push_back(0.0);
    extremes.back() = std::max(extremes.back(), std::abs(error));
    last = error;
  }
  ASSERT_EQ(extremes.size(), 3u);
  for (const double extreme : extremes) EXPECT_NEAR(extreme, result[0].refit.max, 0.02 * result[0].refit.max);
}

// Published to six digits, and found: Schlick's power over even cosines, in the mean square.
TEST_F(Recipes, SphericalGaussianIsFound) {
  const auto result = fits(R"({"name":"a","form":"spherical_gaussian_fresnel","target":"schlick_power",
      "domain":{"cosine":{"from":0,"to":1,"count":1001}},"metric":"absolute","free":["a","b"],
      "published":{"a":"-5.55473","b":"-6.98316"}})");
  EXPECT_TRUE(result[0].readings[0].meets_published);
  EXPECT_EQ(result[0].readings[0].norm, FormNorm::rms);
  EXPECT_NEAR(result[0].constants[0].value, -5.55473, 1e-4);
  EXPECT_NEAR(result[0].constants[1].value, -6.98316, 1e-4);
}

// A form that can be exact is: k = alpha/2 at alpha = 1.
TEST_F(Recipes, ExactFormsAreMet) {
  const auto result = fits(R"({"name":"a","form":"schlick_masking","target":"smith_ggx_g1","each":{"alpha":[0.5,1]},
      "domain":{"cos_theta":{"from":0.02,"to":1,"count":50}},"metric":"absolute","free":["c"],"published":{"c":0.3}})");
  ASSERT_EQ(result.size(), 2u);
  EXPECT_GT(result[0].refit.max, 0.02);
  EXPECT_LT(result[1].refit.max, 1e-9);
  EXPECT_NEAR(result[1].constants[0].value, 0.5, 1e-9);
}

TEST_F(Recipes, SameNumbersTwice) {
  const std::string rows = R"({"name":"a","form":"beckmann_rational","target":"smith_beckmann_cotangent",
      "domain":{"cotangent":{"from":0.01,"to":2,"count":100}},"norm":"max","free":["p1","p2","q1","q2"]})";
  EXPECT_EQ(fits(rows)[0].values(), fits(rows)[0].values());
}

TEST_F(Recipes, BadOnesAreRefusedWithTheirJsonPath) {
  const auto row = [](const std::string& more) {
    return R"({"name":"a","form":"schlick_fresnel","target":"fresnel_dielectric",)" + more + "}";
  };
  const std::string domain = R"("domain":{"cosine":[0.1,1]})";
  expect_refused(row(domain + R"(,"free":["m"])"), "$.rows[0].free[0]", "choose among n");
  expect_refused(row(R"("domain":{},"free":["n"])"), "$.rows[0].domain", "an empty domain");
  expect_refused(row(R"("domain":{"cosine":{"from":0,"to":1,"count":0}},"free":["n"])"),
                 "$.rows[0].domain.cosine.count", "an empty domain");
  expect_refused(row(R"("domain":{"cosine":[]},"free":["n"])"), "$.rows[0].domain.cosine", "the list is empty");
  expect_refused(row(R"("domain":{"cosin":[1]},"free":["n"])"), "$.rows[0].domain.cosin", "cosine, ior");
  expect_refused(row(R"("domain":{"cosine":[1.5]},"free":["n"])"), "$.rows[0].domain.cosine", "out of range");
  expect_refused(row(domain + R"(,"free":["n"],"set":{"ior":0.5})"), "$.rows[0].set.ior", "choose from 1 to 10");
  expect_refused(row(domain + R"(,"free":["n"],"published":{"n":"five"})"), "$.rows[0].published.n", "no number");
  expect_refused(row(domain + R"(,"free":["n"],"metric":"log")"), "$.rows[0].metric", "absolute or relative");
  expect_refused(row(domain + R"(,"free":["n"],"rivals":["joint_visibility"])"), "$.rows[0].rivals[0]",
                 "needs 'cos_theta_i'");
  expect_refused(R"({"name":"a","form":"schlick_masking","target":"fresnel_dielectric",)" + domain + R"(,"free":[]})",
                 "$.rows[0].form", "needs 'cos_theta'");
  expect_refused(R"({"name":"a","form":"schlick_fresnel","target":"fresnel_dielectrics",)" + domain + R"(,"free":[]})",
                 "$.rows[0].target", "did you mean 'fresnel_dielectric'");
}

// docs/recipes.md shows one recipe of each kind; what it shows is read here, and the short one run.
TEST_F(Recipes, OfTheDocumentWork) {
  const std::string page = read_file((fs::path(LOBEFIT_DOCS) / "recipes.md").string());
  int found = 0;
  for (std::size_t at = page.find("```json\n"); at != std::string::npos; at = page.find("```json\n", at)) {
    const std::size_t begin = at + 8, end = page.find("```", begin);
    const fs::path path = folder_ / "shown.json";
    std::ofstream(path) << page.substr(begin, end - begin);
    if (recipe_kind(path) == RecipeKind::approximations) {
      recipe_ = ApproximationRecipe::read(path);
      Monitor monitor;
      for (const ApproximationFit& fit : run_approximations(recipe_, monitor).fits) {
        EXPECT_LT(fit.refit.max, fit.published.max);
      }
    } else {
      EXPECT_EQ(recipe_kind(path), RecipeKind::constants);
      EXPECT_FALSE(Recipe::read(path).rows.empty());
    }
    ++found;
    at = end;
  }
  EXPECT_EQ(found, 2);
}

TEST(ShippedRecipes, OfFormsAreReadAndSaySoToTheSchema) {
  const fs::path data = LOBEFIT_DATA_FOLDER;
  int count = 0;
  for (const auto& file : fs::directory_iterator(data / "recipes")) {
    const Json json = parse_json(read_file(file.path()), file.path().string());
    if (json.value("kind", std::string()) != "approximations") continue;
    ++count;
    EXPECT_FALSE(ApproximationRecipe::read(file.path()).rows.empty()) << file.path();
    EXPECT_EQ(json.at("recipe"), file.path().stem().string());
    const std::string path = (data / "schemas" / "approximation_recipe.json").string();
    const Json schema = parse_json(read_file(path), path);
    const Json& known = schema.at("properties").at("rows").at("items").at("properties");
    for (const Json& row : json.at("rows")) {
      for (const auto& [key, ignored] : row.items()) EXPECT_TRUE(known.contains(key)) << key;
    }
  }
  EXPECT_EQ(count, 5);
}

}  // namespace
}  // namespace lobefit
