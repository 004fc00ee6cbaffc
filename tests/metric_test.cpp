// Quantities, weights and their mean squares, against differences, closed forms and refinement.
#include "reference/metric.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "models/error.h"
#include "reference/render.h"
#include "tests/directions.h"

namespace lobefit {
namespace {

constexpr std::array quantities{Quantity::cosine, Quantity::brdf, Quantity::log, Quantity::cube_root};

Axis axis(const std::string& name, std::vector<double> values, bool midpoints = false) {
  return {name, "degree", std::move(values), midpoints};
}

/// `count` values from 0 to `last`, or the middles of as many cells.
Axis regular(const std::string& name, int count, double last, bool midpoints = false) {
  Axis result = axis(name, {}, midpoints);
  for (int i = 0; i < count; ++i) {
    result.values.push_back(midpoints ? (i + 0.5) * last / count : i * last / (count - 1));
  }
  return result;
}

/// A table with values f(cos theta_i, cos theta_o) and standard errors a tenth of them.
template <class F>
Table make_table(const Grid& grid, int channels, F&& f) {
  Table table;
  table.grid = grid;
  table.channels = channels;
  table.allocate();
  for (int c = 0; c < channels; ++c) {
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      const double value = f(table.wi(entry).z, table.wo(entry).z) * (1 + c);
      const std::size_t slot = static_cast<std::size_t>(c) * table.entries() + entry;
      table.values[slot] = static_cast<float>(value);
      table.stderr_values[slot] = static_cast<float>(0.1 * value);
    }
  }
  return table;
}

Grid coarse_grid() {
  return {axis("theta_i", {0.0, 20.0, 50.0, 80.0}), axis("theta_o", {0.0, 45.0, 85.0}),
          axis("phi", {0.0, 60.0, 180.0})};
}

template <class Act>
void expect_error(ExitCode code, const std::string& fragment, Act&& act) {
  try {
    act();
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << error.what();
  }
}

TEST(Quantities, MeetTheirFormulas) {
  // formulas.md §8 and metric.h, by hand at f = 0.5, cos = 0.25, so that f cos = 1/8.
  EXPECT_DOUBLE_EQ(transform(Quantity::cosine, 0.5, 0.25).value, 3.14159265358979323846 / 8.0);
  EXPECT_DOUBLE_EQ(transform(Quantity::brdf, 0.5, 0.25).value, 3.14159265358979323846 / 2.0);
  EXPECT_DOUBLE_EQ(transform(Quantity::log, 0.5, 0.25).value, std::log(1.125));
  EXPECT_DOUBLE_EQ(transform(Quantity::cube_root, 0.5, 0.25).value, 0.5);
}

TEST(Quantities, SlopesAreDerivatives) {
  UniformNumbers uniform(1);
  for (const Quantity quantity : quantities) {
    for (int trial = 0; trial < 200; ++trial) {
      const double sign = trial % 4 == 0 ? -1.0 : 1.0;  // measured values may be negative
      const double f = sign * std::pow(10.0, uniform.between(-3.0, 2.0)), cosine = uniform.between(0.01, 1.0);
      const double step = 1e-5 * std::abs(f);
      const double difference =
          (transform(quantity, f + step, cosine).value - transform(quantity, f - step, cosine).value) / (2.0 * step);
      EXPECT_NEAR(transform(quantity, f, cosine).slope / difference, 1.0, 1e-7)
          << quantity_names[static_cast<std::size_t>(quantity)] << ", f " << f << ", cosine " << cosine;
    }
  }
}

TEST(Quantities, AreFiniteEverywhere) {
  for (const Quantity quantity : quantities) {
    for (const double f : {0.0, -0.0, 1e-300, -1e-300, -1.0, -1e6, 1e30}) {
      for (const double cosine : {0.0, 1e-17, 1.0}) {
        const ValueAndSlope result = transform(quantity, f, cosine);
        EXPECT_TRUE(std::isfinite(result.value)) << f << " " << cosine;
        EXPECT_TRUE(std::isfinite(result.slope)) << f << " " << cosine;
      }
    }
  }
}

TEST(Quantities, HaveNames) {
  for (const Quantity quantity : quantities) {
    EXPECT_EQ(parse_quantity(quantity_names[static_cast<std::size_t>(quantity)]), quantity);
  }
  expect_error(ExitCode::usage, "cosine, brdf, log, cube_root", [] { parse_quantity("cos"); });
  EXPECT_TRUE(parse_weights("uniform").empty());
  EXPECT_EQ(parse_weights("sin_theta_i,cos_theta_i,cos_theta_i,quadrature"),
            (std::vector{WeightFactor::sin_theta_i, WeightFactor::cos_theta_i, WeightFactor::cos_theta_i,
                         WeightFactor::quadrature}));
  for (const char* text : {"", "sin", "uniform,uniform", "sin_theta_i,", ",sin_theta_i"}) {
    expect_error(ExitCode::usage, "choose from", [&] { parse_weights(text); });
  }
}

TEST(Weights, SumToOneAndVanishWhereMasked) {
  Table table = make_table(coarse_grid(), 1, [](double i, double o) { return 0.1 + i * o; });
  table.valid[7] = table.valid[20] = 0;
  for (const char* text : {"uniform", "sin_theta_i,sin_theta_o", "cos_theta_i,cos_theta_o", "quadrature",
                           "sin_theta_i,quadrature", "inverse_variance", "cos_theta_i,cos_theta_i,cos_theta_i"}) {
    for (const Quantity quantity : quantities) {
      const std::vector<double> weights = entry_weights(table, parse_weights(text), quantity);
      ASSERT_EQ(weights.size(), table.entries());
      EXPECT_NEAR(std::accumulate(weights.begin(), weights.end(), 0.0), 1.0, 1e-13) << text;
      EXPECT_EQ(weights[7], 0.0);
      EXPECT_EQ(weights[20], 0.0);
      for (const double weight : weights) EXPECT_GE(weight, 0.0);
    }
  }
}

TEST(Weights, AreProductsOfTheirFactors) {
  const Table table = make_table(coarse_grid(), 1, [](double i, double o) { return 0.1 + i * o; });
  const auto ratio = [&](const char* text, std::size_t a, std::size_t b) {
    const std::vector<double> weights = entry_weights(table, parse_weights(text), Quantity::brdf);
    return weights[a] / weights[b];
  };
  const auto entry = [&](std::size_t o, std::size_t i, std::size_t p) { return o * table.width() + i * 3 + p; };
  const std::size_t a = entry(2, 3, 0), b = entry(1, 1, 2);
  const auto degree = [](double x) { return x * 3.14159265358979323846 / 180.0; };
  EXPECT_NEAR(ratio("uniform", a, b), 1.0, 1e-13);
  EXPECT_NEAR(ratio("sin_theta_i", a, b), std::sin(degree(80)) / std::sin(degree(20)), 1e-12);
  EXPECT_NEAR(ratio("sin_theta_o", a, b), std::sin(degree(85)) / std::sin(degree(45)), 1e-12);
  EXPECT_NEAR(ratio("cos_theta_i,cos_theta_i", a, b), std::pow(std::cos(degree(80)) / std::cos(degree(20)), 2), 1e-12);
  EXPECT_NEAR(ratio("cos_theta_o", a, b), std::cos(degree(85)) / std::cos(degree(45)), 1e-12);
  // Trapezoids: theta_i 80 has 15, 20 has 25; theta_o 85 has 20, 45 has 42.5; phi 0 has 30, 180 has 60.
  EXPECT_NEAR(ratio("quadrature", a, b), 15.0 * 20.0 * 30.0 / (25.0 * 42.5 * 60.0), 1e-12);
  // Errors are a tenth of the values, and the slope of brdf is π everywhere.
  const double relative = ratio("inverse_variance", a, b) / std::pow(table.value(b) / table.value(a), 2);
  EXPECT_NEAR(relative, 1.0, 1e-6);
}

TEST(Weights, InverseVarianceFollowsTheQuantity) {
  // By the delta method the variance of the quantity is (slope × stderr)².
  const Table table = make_table(coarse_grid(), 3, [](double i, double o) { return 0.2 + i * o; });
  for (const Quantity quantity : quantities) {
    const std::vector<double> weights = entry_weights(table, {WeightFactor::inverse_variance}, quantity);
    const auto variance = [&](std::size_t entry) {
      double sum = 0.0;
      for (int c = 0; c < 3; ++c) {
        const double f = table.value(entry, c), step = 1e-5 * f, cosine = table.wi(entry).z;
        const double slope =
            (transform(quantity, f + step, cosine).value - transform(quantity, f - step, cosine).value) / (2.0 * step);
        sum += std::pow(slope * table.standard_error(entry, c), 2);
      }
      return sum;
    };
    EXPECT_NEAR(weights[30] / weights[4], variance(4) / variance(30), 1e-6);
  }
}

TEST(Weights, RefuseTablesThatCarryNone) {
  Table table = make_table(coarse_grid(), 1, [](double, double) { return 0.3; });
  table.stderr_values[5] = 0.0f;
  expect_error(ExitCode::invalid_input, "inverse variance",
               [&] { entry_weights(table, {WeightFactor::inverse_variance}, Quantity::brdf); });
  std::fill(table.valid.begin(), table.valid.end(), std::uint8_t{0});
  expect_error(ExitCode::invalid_input, "masked", [&] { entry_weights(table, {}, Quantity::brdf); });
  const Table on_normal = make_table({axis("theta_i", {0.0}), axis("theta_o", {0.0}), axis("phi", {0.0})}, 1,
                                     [](double, double) { return 0.3; });
  expect_error(ExitCode::invalid_input, "zero",
               [&] { entry_weights(on_normal, {WeightFactor::sin_theta_i}, Quantity::brdf); });
}

TEST(RmsDifference, OfAConstantOffsetHasItsClosedForm) {
  constexpr float offset = 0.125f;
  for (const int channels : {1, 3}) {
    const Table table = make_table(coarse_grid(), channels, [](double, double) { return 0.25; });
    std::vector<float> values = table.values;
    for (float& value : values) value += offset;
    const std::vector<double> uniform = entry_weights(table, {}, Quantity::brdf);
    EXPECT_NEAR(rms_difference(table, values, Quantity::brdf, uniform), pi * offset, 1e-6);
    // π offset √(mean of cos²) over theta_i = 0, 20, 50, 80.
    const double mean_square =
        (1.0 + std::pow(std::cos(pi / 9.0), 2) + std::pow(std::cos(pi / 3.6), 2) + std::pow(std::cos(pi / 2.25), 2)) /
        4.0;
    EXPECT_NEAR(rms_difference(table, values, Quantity::cosine, uniform), pi * offset * std::sqrt(mean_square), 1e-6);
    EXPECT_EQ(rms_difference(table, table.values, Quantity::log, uniform), 0.0);
  }
}

TEST(RmsDifference, IgnoresWhatIsMasked) {
  Table table = make_table(coarse_grid(), 1, [](double, double) { return 0.25; });
  std::vector<float> values = table.values;
  values[4] = std::nanf("");
  table.valid[4] = 0;
  EXPECT_EQ(rms_difference(table, values, Quantity::cosine, entry_weights(table, {}, Quantity::cosine)), 0.0);
}

TEST(RmsDifference, DoesNotDependOnTheGridWithQuadratureWeights) {
  // On finer and finer grids the weighted mean square of a difference δ cos²θ_i tends to
  // π² δ² ∫ cos⁴ sin cos dθ_i / ∫ sin cos dθ_i = π² δ² / 3.
  constexpr double offset = 0.125;
  const std::vector<WeightFactor> factors = parse_weights("quadrature,sin_theta_i,cos_theta_i,sin_theta_o");
  const double truth = pi * offset / std::sqrt(3.0);
  for (const bool midpoints : {false, true}) {
    double previous = 1.0;
    for (const int count : {8, 16, 32, 64}) {
      // Points can't reach 90 degrees by Grid's rule, but a table may be made by hand.
      const Grid grid{regular("theta_i", count, 90.0, midpoints), regular("theta_o", count / 2, 90.0, midpoints),
                      regular("phi", 3, 180.0, midpoints)};
      const Table table = make_table(grid, 1, [](double, double) { return 0.25; });
      std::vector<float> values = table.values;
      for (std::size_t entry = 0; entry < values.size(); ++entry) {
        values[entry] += static_cast<float>(offset * std::pow(table.wi(entry).z, 2));
      }
      const double error = std::abs(
          rms_difference(table, values, Quantity::brdf, entry_weights(table, factors, Quantity::brdf)) - truth);
      EXPECT_LT(error, 0.4 * previous) << "second order: halving the step quarters the error";
      previous = error;
    }
    EXPECT_LT(previous, 1e-3 * truth);
  }
}

}  // namespace
}  // namespace lobefit
