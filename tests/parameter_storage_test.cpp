// Parameters in few bits: codes against the compiler's own binary16, UNORM's steps and the sRGB standard; errors
// against sums of their own.
#include "evaluate/parameter_storage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "evaluate/check.h"

namespace lobefit {
namespace {

__extension__ using Half = _Float16;

constexpr ParameterInfo unit{.name = "unit", .components = 1};
constexpr ParameterInfo wide{.name = "wide", .lower = -1.0, .upper = 256.0, .components = 3};

double decoded(std::string_view code, double value, const ParameterInfo& info = unit, int component = 0) {
  return find_parameter_code(code).decoded(value, info, component);
}

double rms(const QuantityErrors& errors, Quantity quantity) { return errors[static_cast<std::size_t>(quantity)]; }

ParameterStorageError error_of(std::string_view name, const std::vector<std::string>& codes,
                               const std::vector<ParameterValues>& sets) {
  const Model& model = find_model(name);
  return parameter_storage_error(model, sets, choose_codes(model.parameters, codes));
}

std::vector<ParameterValues> varied(std::string_view name) {
  const Model& model = find_model(name);
  std::vector<std::string> names;
  for (const ParameterInfo& info : model.parameters) names.emplace_back(info.name);
  return varied_parameters(model.defaults(), names, 16, 1);
}

ParameterValues with(std::string_view model, std::string_view name, std::vector<double> value) {
  ParameterValues values = find_model(model).defaults();
  values.set(name, value);
  return values;
}

TEST(Fp16, IsBinary16) {
  // By hand: ten bits of fraction, halves to even, 2^-24 the smallest.
  EXPECT_EQ(decoded("fp16", 1.0 / 3.0), 1365.0 / 4096.0);
  EXPECT_EQ(decoded("fp16", 0.1), 1638.0 / 16384.0);
  EXPECT_EQ(decoded("fp16", 2049.0), 2048.0);
  EXPECT_EQ(decoded("fp16", 2051.0), 2052.0);
  EXPECT_EQ(decoded("fp16", 65519.0), 65504.0);
  EXPECT_EQ(decoded("fp16", 5e-8), 0x1p-24);
  EXPECT_EQ(decoded("fp16", 2e-8), 0.0);
  // By the compiler, over every scale.
  for (double x = 1e-9; x < 65504.0; x *= 1.0037) {
    const auto expected = static_cast<double>(static_cast<Half>(static_cast<float>(x)));
    EXPECT_EQ(decoded("fp16", x), expected) << x;
    EXPECT_EQ(decoded("fp16", -x), -expected) << x;
  }
}

TEST(Fp16, EndsAtItsLargestNumber) {
  EXPECT_EQ(decoded("fp16", 1e6), 65504.0);
  EXPECT_EQ(decoded("fp16", -1e9), -65504.0);
}

TEST(Unorm, IsTheNearestOfEvenSteps) {
  struct Case {
    std::string_view code;
    int component;
    double steps;
  };
  for (const auto& [code, component, steps] : {Case{"unorm8", 0, 255}, Case{"unorm16", 2, 65535},
                                               Case{"rgb776", 0, 127}, Case{"rgb776", 1, 127}, Case{"rgb776", 2, 63}}) {
    for (const ParameterInfo& info : {unit, wide}) {
      const double range = info.upper - info.lower, step = range / steps;
      double worst = 0.0;
      for (int k = 0; k <= 100000; ++k) {
        const double x = info.lower + range * k / 100000.0, found = decoded(code, x, info, component);
        const double place = (found - info.lower) / step;
        EXPECT_NEAR(place, std::round(place), 1e-9) << code << " " << x;
        worst = std::max(worst, std::abs(found - x));
      }
      // Samples lie at most a hundredth of a millionth of the range off the middle between two codes.
      EXPECT_LE(worst, 0.5 * step * (1.0 + 1e-9)) << code;
      EXPECT_GE(worst, 0.5 * step - 1e-5 * range) << code;
      EXPECT_EQ(decoded(code, info.lower, info, component), info.lower);
      EXPECT_EQ(decoded(code, info.upper, info, component), info.upper);
    }
  }
}

TEST(Srgb, IsTheNearestOfTheStandardsNumbers) {
  // IEC 61966-2-1 in extended precision.
  const auto standard = [](long double code) {
    return code <= 0.04045L ? code / 12.92L : std::pow((code + 0.055L) / 1.055L, 2.4L);
  };
  for (const auto& [code, last] : {std::pair{"srgb8", 255}, std::pair{"srgb776", 127}}) {
    for (int k = 0; k <= 997; ++k) {
      const double x = k / 997.0;
      long double nearest = 0.0L;
      for (int c = 0; c <= last; ++c) {
        const long double value = standard(static_cast<long double>(c) / last);
        if (std::abs(value - x) < std::abs(nearest - x)) nearest = value;
      }
      EXPECT_NEAR(decoded(code, x), static_cast<double>(nearest), 1e-14) << code << " " << x;
    }
  }
}

TEST(Square776, IsAPerfectSquare) {
  for (int k = 0; k <= 1000; ++k) {
    const double root = 63.0 * std::sqrt(decoded("square776", k / 1000.0, wide, 2) / 257.0 + 1.0 / 257.0);
    EXPECT_NEAR(root, std::round(root), 1e-9);
  }
}

TEST(StorageChoice, NamesOutrankAll) {
  const Model& model = find_model("callisto");
  const StorageChoice choice = choose_codes(model.parameters, {"albedo=rgb776", "fp16"});
  for (std::size_t k = 0; k < choice.size(); ++k) {
    const ParameterInfo& info = model.parameters[k];
    if (!info.choices.empty())
      EXPECT_EQ(choice[k], nullptr) << "a choice of formula is no number";
    else
      EXPECT_EQ(choice[k]->name, info.name == "albedo" ? "rgb776" : "fp16") << info.name;
  }
  const StorageChoice one = choose_codes(model.parameters, {"f0=srgb8"});
  EXPECT_EQ(std::ranges::count(one, nullptr), static_cast<std::ptrdiff_t>(one.size()) - 1);
  for (const char* broken : {"fp15", "", "=fp16", "albedo=", "albdo=fp16", "dual_specular=fp16"}) {
    try {
      choose_codes(model.parameters, {broken});
      ADD_FAILURE() << broken;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage) << broken;
    }
  }
}

TEST(ParameterStorage, LambertByASumOfItsOwn) {
  // .3 is 76.5 steps of 255: in extended precision 76/255 and 77/255 are as near; .301 is 76.755.
  const double given = 0.301, read = 77.0 / 255.0;
  const ParameterStorageError error = error_of("lambert", {"unorm8"}, {with("lambert", "albedo", {given})});
  // The grid's 45 midpoints over 0…80° in θi, weighted by the sine; Lambert knows neither θo nor φ.
  double weights = 0.0, log = 0.0, cosine = 0.0;
  for (int k = 0; k < 45; ++k) {
    const double theta = (k + 0.5) * 80.0 / 45.0 * std::numbers::pi / 180.0, c = std::cos(theta);
    weights += std::sin(theta);
    log += std::sin(theta) *
           std::pow(std::log(1.0 + read * c / std::numbers::pi) - std::log(1.0 + given * c / std::numbers::pi), 2);
    cosine += std::sin(theta) * std::pow((read - given) * c, 2);
  }
  EXPECT_EQ(error.parameter_sets, 1u);
  EXPECT_EQ(error.pairs, 45u * 45u * 90u);
  ASSERT_EQ(error.alone.size(), 1u);
  EXPECT_EQ(error.alone[0].name, "albedo");
  EXPECT_EQ(error.alone[0].bits, 24);
  EXPECT_NEAR(error.alone[0].largest_error, read - given, 1e-15);
  EXPECT_NEAR(rms(error.together, Quantity::log), std::sqrt(log / weights), 1e-12);
  EXPECT_NEAR(rms(error.together, Quantity::cosine), std::sqrt(cosine / weights), 1e-12);
  EXPECT_EQ(error.together, error.alone[0].rms);
}

TEST(ParameterStorage, WhatIsRepresentableCostsNothing) {
  for (const ParameterCode& code : parameter_codes()) {
    const ParameterStorageError error =
        error_of("lambert", {std::string(code.name)},
                 {with("lambert", "albedo", {1.0, 0.0, 1.0}), with("lambert", "albedo", {0.0})});
    EXPECT_EQ(error.together, QuantityErrors{}) << code.name;
    EXPECT_EQ(error.alone[0].largest_error, 0.0) << code.name;
  }
  // Sixteenths are exact in binary16 and not in UNORM.
  const std::vector sets{with("lambert", "albedo", {0.25, 0.5, 0.0625})};
  EXPECT_EQ(error_of("lambert", {"fp16"}, sets).together, QuantityErrors{});
  EXPECT_GT(rms(error_of("lambert", {"unorm8"}, sets).together, Quantity::log), 0.0);
  // What is not stored stays as it is.
  EXPECT_EQ(error_of("callisto", {"terminator=fp16"}, {find_model("callisto").defaults()}).together, QuantityErrors{});
}

TEST(ParameterStorage, TheWorstComesFirst) {
  const ParameterStorageError error = error_of("proxima", {"fp16", "albedo=rgb776"}, varied("proxima"));
  ASSERT_EQ(error.alone.size(), 5u);
  EXPECT_EQ(error.alone[0].name, "albedo");
  EXPECT_EQ(error.alone[0].code->name, "rgb776");
  EXPECT_LE(error.alone[0].largest_error, 0.5 / 63.0 + 1e-12);
  for (std::size_t k = 1; k < error.alone.size(); ++k)
    EXPECT_GE(rms(error.alone[k - 1].rms, Quantity::log), rms(error.alone[k].rms, Quantity::log));
  EXPECT_EQ(error.non_finite, 0u);
}

TEST(ParameterStorage, RoundingIsAsGoodAsRandom) {
  // Of a step s the mean square is s²/12. 64 albedos of three channels leave ±√(4/5/192)/2 = 3 % of its root.
  std::vector<ParameterValues> sets;
  const auto albedo = [](int k) { return std::fmod(k * std::numbers::phi, 1.0); };
  for (int k = 0; k < 192; k += 3) sets.push_back(with("lambert", "albedo", {albedo(k), albedo(k + 1), albedo(k + 2)}));
  double weights = 0.0, squares = 0.0;
  for (int k = 0; k < 45; ++k) {
    const double theta = (k + 0.5) * 80.0 / 45.0 * std::numbers::pi / 180.0;
    weights += std::sin(theta);
    squares += std::sin(theta) * std::pow(std::cos(theta), 2);
  }
  for (const auto& [code, steps] : {std::pair{"unorm8", 255.0}, std::pair{"unorm16", 65535.0}}) {
    const double expected = std::sqrt(squares / weights / 12.0) / steps;
    EXPECT_NEAR(rms(error_of("lambert", {code}, sets).together, Quantity::cosine), expected, 4 * 0.032 * expected)
        << code;
  }
}

TEST(ParameterStorage, TellsWhatBinary16CannotHold) {
  const std::vector<ParameterValues> sets = varied("slab");
  int beyond = 0;
  for (const ParameterValues& set : sets) beyond += set.get("emissive") > 65504.0 ? 1 : 0;
  ASSERT_GT(beyond, 0);
  const ParameterStorageError error = error_of("slab", {"emissive=fp16", "thickness=fp16"}, sets);
  for (const StoredParameterError& one : error.alone)
    EXPECT_EQ(one.overflows, one.name == "emissive" ? beyond : 0) << one.name;
}

}  // namespace
}  // namespace lobefit
