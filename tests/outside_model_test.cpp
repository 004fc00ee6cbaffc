// A model that the repository does not have, added by a program of its own: docs/adding_a_model.md.

#include <gtest/gtest.h>

#include <cmath>

#include "evaluate/check.h"
#include "evaluate/make_float_model.h"
#include "fit/fit.h"
#include "fit/make_dual_model.h"
#include "models/make_model.h"
#include "reference/render.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/minnaert.h"

namespace lobefit {

namespace {

/// What a program does once, before it uses the registry.
class OutsideModel : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    add_model(make_model<Minnaert>());
    add_float_model(make_float_model<Minnaert>());
    add_dual_model(make_dual_model<Minnaert>());
  }
  const Model& model_ = find_model("minnaert");
  Monitor silent_;

  ParameterValues with(double albedo, double k) const {
    ParameterValues values = model_.defaults();
    values.set("albedo", albedo);
    values.set("k", k);
    return values;
  }
};

TEST_F(OutsideModel, IsEvaluated) {
  // k = 3, θ = 60°, 60°: ρ 4/(2π) (¼)²
  const Rgb f = model_.evaluate(with(0.5, 3.0).flat(), direction(radians(60.0), 0.0), direction(radians(60.0), 2.0));
  EXPECT_NEAR(f.x, 0.5 / (8.0 * pi), 1e-15);
  // E(μo) = ρ (k + 1)/(2π) μo^(k - 1) 2π/(k + 1) = ρ μo^(k - 1)
  double albedo = 0.0;
  const Direction wo = direction(std::acos(0.7), 0.0);
  for (const auto& [mu, weight] : gauss_legendre(16, 0.0, 1.0)) {
    albedo += 2.0 * pi * weight * mu * model_.evaluate(with(0.9, 3.0).flat(), direction(std::acos(mu), 1.0), wo).x;
  }
  EXPECT_NEAR(albedo, 0.9 * 0.49, 1e-12);
}

TEST_F(OutsideModel, IsFitted) {
  // The table is made by hand, not by the text.
  const auto angles = [](const char* name, std::vector<double> values) {
    return Axis{name, "degree", std::move(values), false};
  };
  const Grid grid{angles("theta_i", {0.0, 20.0, 40.0, 60.0, 80.0}), angles("theta_o", {0.0, 30.0, 60.0, 80.0}),
                  angles("phi", {0.0, 180.0})};
  Table table = render(model_, model_.defaults(), {}, grid, silent_);
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const double cosines = table.wi(entry).z * table.wo(entry).z;
    table.values[entry] = static_cast<float>(0.6 * 3.5 / (2.0 * pi) * std::pow(cosines, 1.5));
  }
  const Fit found = fit(model_, model_.defaults(), table, {.free = {"albedo", "k"}}, silent_);
  EXPECT_TRUE(found.solution.converged);
  for (const FitParameter& parameter : found.parameters) {
    EXPECT_NEAR(parameter.estimate.value, parameter.name == "k" ? 2.5 : 0.6, 1e-5) << parameter.name;
  }
}

TEST_F(OutsideModel, IsChecked) {
  CheckOptions options;
  options.pairs = 1 << 14;
  const CheckResult result =
      check_model(model_, varied_parameters(model_.defaults(), {"albedo", "k"}, 8, 1), options, SimdDevice(), silent_);
  EXPECT_TRUE(result.passed);
  EXPECT_GT(result.max_rel, 0.0);
}

TEST_F(OutsideModel, IsExported) {
  const std::vector<ShaderParameter> parameters{{model_.parameters[0], {1.0, 1.0, 1.0}, ""},
                                                {model_.parameters[1], {1.5}, ""}};
  const std::string text = print_shader(find_float_model("minnaert").trace(), "hlsl", *model_.info, parameters, {});
  EXPECT_NE(text.find("float3 Lobefit_minnaert(float3 wi, float3 wo, Lobefit_minnaert_Parameters p)"),
            std::string::npos);
  EXPECT_NE(text.find("float limb = pow(max(cos_theta_i * cos_theta_o, 1e-36), p.k - 1.0);"), std::string::npos);
  EXPECT_NE(text.find("p.k = 1.5;"), std::string::npos);
}

TEST_F(OutsideModel, NamesStayUnique) {
  EXPECT_THROW(add_model(make_model<Minnaert>()), Error);
  EXPECT_EQ(models().back().info->name, "minnaert");
}

}  // namespace
}  // namespace lobefit
