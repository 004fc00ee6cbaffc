// The laws of reflection, held against every registered model: a line in models/list.def is all that a new model needs.

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <string>

#include "evaluate/conditioning.h"
#include "evaluate/float_model.h"
#include "fit/dual.h"
#include "models/registry.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/model_types.h"

namespace lobefit {
namespace {

std::array<double, 3> channels(const Rgb& value) { return {value.x, value.y, value.z}; }
double smallest(const Rgb& value) { return std::min({value.x, value.y, value.z}); }
double largest(const Rgb& value) { return std::max({value.x, value.y, value.z}); }
bool is_finite(const Rgb& value) { return std::isfinite(value.x) && std::isfinite(value.y) && std::isfinite(value.z); }

std::string text(const Direction& w) {
  return "(" + number_text(w.x) + ", " + number_text(w.y) + ", " + number_text(w.z) + ")";
}

std::string text(std::span<const double> flat) {
  std::string joined;
  for (const double value : flat) joined += (joined.empty() ? "" : " ") + number_text(value);
  return joined;
}

std::string where(std::span<const double> flat, const Direction& wi, const Direction& wo) {
  return "parameters " + text(flat) + ", wi " + text(wi) + ", wo " + text(wo);
}

std::vector<double> to_vector(std::span<const double> flat) { return {flat.begin(), flat.end()}; }

/// Corners, points between them, and each parameter swept over its range with the others at their defaults: troubles
/// such as a term that is negative only between two roughnesses are narrow.
std::vector<std::vector<double>> parameter_sets(const std::vector<ParameterInfo>& list) {
  std::vector<std::vector<double>> sets = corner_parameters(list, 11);
  const std::vector<std::vector<double>> interior = interior_parameters(list, 8, 0.0, 12);
  sets.insert(sets.end(), interior.begin(), interior.end());
  constexpr int steps = 24;
  for (const ParameterInfo& info : list) {
    for (int step = 0; step <= steps; ++step) {
      std::vector<double> flat = to_vector(ParameterValues(list, "").flat());
      std::fill_n(flat.begin() + info.offset, info.components, info.lower + (info.upper - info.lower) * step / steps);
      sets.push_back(flat);
    }
  }
  return sets;
}

/// The pairs, and for a model that transmits each of them again with its light behind the surface.
std::vector<DirectionPair> with_light_behind(const ModelInfo& info, std::vector<DirectionPair> pairs) {
  if (!info.transmits) return pairs;
  const std::size_t count = pairs.size();
  for (std::size_t i = 0; i < count; ++i) {
    const auto [wi, wo] = pairs[i];
    pairs.push_back({{wi.x, wi.y, -wi.z}, wo});
  }
  return pairs;
}

/// Runs its tests on one model, found by name.
class Laws : public ::testing::TestWithParam<std::string> {
 protected:
  const Model& model_ = find_model(GetParam());
  const ModelInfo& info_ = *model_.info;
  const FloatModel& float_model_ = find_float_model(GetParam());
};

std::vector<std::string> model_names() {
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.info->name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Models, Laws, ::testing::ValuesIn(model_names()), [](const auto& test) { return test.param; });

TEST_P(Laws, RoomsAgreeOnNames) { EXPECT_EQ(float_model_.name, info_.name); }

TEST_P(Laws, SignIsAsClaimed) {
  std::vector<DirectionPair> pairs = random_pairs(1000, 1);
  const std::vector<DirectionPair> hostile = hostile_pairs();
  pairs.insert(pairs.end(), hostile.begin(), hostile.end());
  pairs = with_light_behind(info_, pairs);
  FloatPairs float_pairs(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
  FloatRgb values(pairs.size());

  double worst = 0.0, worst_in_float = 0.0;
  std::string place, place_in_float;
  for (const std::vector<double>& flat : parameter_sets(model_.parameters)) {
    const std::vector<float> float_flat(flat.begin(), flat.end());
    float_model_.evaluate(float_flat, float_pairs, 0, pairs.size(), values);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto& [wi, wo] = pairs[i];
      const double value = smallest(model_.evaluate(flat, wi, wo));
      if (value < worst) worst = value, place = where(flat, wi, wo);
      const double in_float = smallest({values.r[i], values.g[i], values.b[i]});
      if (in_float < worst_in_float) worst_in_float = in_float, place_in_float = where(flat, wi, wo);
    }
  }
  RecordProperty("smallest_value", number_text(worst));
  RecordProperty("smallest_value_in_float", number_text(worst_in_float));
  if (info_.non_negative) {
    EXPECT_GE(worst, 0.0) << place;
    EXPECT_GE(worst_in_float, 0.0) << place_in_float;
  } else {
    EXPECT_LT(worst, -1e-3) << "the model is never negative and could say so";
  }
}

TEST_P(Laws, NothingIsReflectedBelowTheHorizon) {
  if (info_.kind == ModelKind::hair) GTEST_SKIP() << "a fibre has no horizon";
  const std::vector<double> flat = to_vector(model_.defaults().flat());
  const Direction above = direction(0.5, 1.0);
  for (const double cosine : {0.0, -0.0, -1e-30, -1e-6, -0.5, -1.0}) {
    const double sine = std::sqrt((1.0 - cosine) * (1.0 + cosine));
    for (const Direction& below : {Direction{sine, 0.0, cosine}, Direction{-sine, 0.0, cosine}}) {
      for (const auto& [wi, wo] : {DirectionPair{below, above}, {above, below}, {below, below}}) {
        if (info_.transmits && wo.z > 0.0) continue;
        for (const double value : channels(model_.evaluate(flat, wi, wo))) EXPECT_EQ(value, 0.0) << where(flat, wi, wo);
      }
    }
  }
  // Off the retro direction: some reflectances are 0 at normal incidence on the facet.
  EXPECT_GT(largest(model_.evaluate(flat, above, direction(0.6, 2.0))), 0.0);
}

TEST_P(Laws, TermsAreGrey) {
  if (info_.kind != ModelKind::term) GTEST_SKIP() << "not a term";
  for (const std::vector<double>& flat : interior_parameters(model_.parameters, 4, 0.0, 13)) {
    for (const auto& [wi, wo] : random_pairs(20, 14)) {
      const Rgb value = model_.evaluate(flat, wi, wo);
      EXPECT_EQ(value.x, value.y);
      EXPECT_EQ(value.x, value.z);
    }
  }
}

TEST_P(Laws, ValuesAreFiniteOnHostileDirections) {
  const std::vector<DirectionPair> pairs = with_light_behind(info_, hostile_pairs());
  FloatPairs float_pairs(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
  FloatRgb values(pairs.size());
  for (const std::vector<double>& flat : parameter_sets(model_.parameters)) {
    const std::vector<float> float_flat(flat.begin(), flat.end());
    float_model_.evaluate(float_flat, float_pairs, 0, pairs.size(), values);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto& [wi, wo] = pairs[i];
      ASSERT_TRUE(is_finite(model_.evaluate(flat, wi, wo))) << where(flat, wi, wo);
      ASSERT_TRUE(is_finite(Rgb{values.r[i], values.g[i], values.b[i]})) << "in float: " << where(flat, wi, wo);
    }
  }
}

TEST_P(Laws, ReciprocityIsAsClaimed) {
  double worst = 0.0;
  std::string place;
  for (const std::vector<double>& flat : parameter_sets(model_.parameters)) {
    for (const auto& [wi, wo] : random_pairs(1000, 2)) {
      const auto forward = channels(model_.evaluate(flat, wi, wo));
      const auto backward = channels(model_.evaluate(flat, wo, wi));
      for (std::size_t k = 0; k < 3; ++k) {
        // The floor is for Schlick's (1 - V·H)⁵ next to V·H = 1 with f0 = 0: 1e-16, and all rounding.
        const double scale = std::max({std::abs(forward[k]), std::abs(backward[k]), 1e-9});
        const double violation = std::abs(forward[k] - backward[k]) / scale;
        if (violation > worst) worst = violation, place = where(flat, wi, wo);
      }
    }
  }
  RecordProperty("worst_relative_violation", number_text(worst));
  if (info_.reciprocal) {
    EXPECT_LE(worst, 1e-12) << place;
  } else {
    EXPECT_GT(worst, 1e-3) << "the model is reciprocal and could say so";
  }
}

TEST_P(Laws, IsotropyIsAsClaimed) {
  const double cosine = std::cos(2.1), sine = std::sin(2.1);
  const auto turned = [&](const Direction& w) {
    return Direction{cosine * w.x - sine * w.y, sine * w.x + cosine * w.y, w.z};
  };
  double worst = 0.0;
  std::string place;
  for (const std::vector<double>& flat : parameter_sets(model_.parameters)) {
    for (const auto& [wi, wo] : random_pairs(500, 10)) {
      const auto here = channels(model_.evaluate(flat, wi, wo));
      const auto there = channels(model_.evaluate(flat, turned(wi), turned(wo)));
      for (std::size_t k = 0; k < 3; ++k) {
        const double change = std::abs(here[k] - there[k]) / (1.0 + std::abs(here[k]));
        if (change > worst) worst = change, place = where(flat, wi, wo);
      }
    }
  }
  RecordProperty("worst_change", number_text(worst));
  if (info_.isotropic) {
    EXPECT_LE(worst, 1e-11) << place;
  } else {
    EXPECT_GT(worst, 1e-3) << "the model is isotropic and could say so";
  }
}

/// ∫ f |cos θ_i| dω_i for a view at elevation `cosine_o`, the largest of the three channels. Over both hemispheres if
/// the model transmits.
double directional_albedo(const Model& model, std::span<const double> flat, double cosine_o) {
  constexpr int azimuths = 64;
  const Direction wo{std::sqrt((1.0 - cosine_o) * (1.0 + cosine_o)), 0.0, cosine_o};
  Rgb albedo{};
  if (model.sample) {
    // Narrow lobes fall between fixed directions. A Fibonacci lattice: a grid's rows would not hit the shares of lobes
    // that are picked by the first number.
    constexpr int count = 2584, generator = 1597;
    for (int i = 0; i < count; ++i) {
      const std::array<double, 2> u{(i + 0.5) / count, (i * generator % count + 0.5) / count};
      const Direction wi = model.sample(flat, wo, u);
      if (wi.z <= 0.0 && !model.info->transmits) continue;
      albedo = albedo + model.evaluate(flat, wi, wo) * (std::abs(wi.z) / (model.pdf(flat, wi, wo) * count));
    }
    return largest(albedo);
  }
  // Cut where light and view are equally high: min and max of the two angles have a kink there.
  std::vector<std::pair<double, double>> intervals{{0.0, cosine_o}, {cosine_o, 1.0}};
  if (model.info->transmits) intervals.emplace_back(-1.0, 0.0);
  for (const auto& [lower, upper] : intervals) {
    for (const auto& [cosine, weight] : gauss_legendre(16, lower, upper)) {
      const double sine = std::sqrt((1.0 - cosine) * (1.0 + cosine));
      for (int k = 0; k < azimuths; ++k) {
        const double azimuth = 2.0 * pi * (k + 0.5) / azimuths;
        const Direction wi{sine * std::cos(azimuth), sine * std::sin(azimuth), cosine};
        albedo = albedo + model.evaluate(flat, wi, wo) * (std::abs(cosine) * weight * 2.0 * pi / azimuths);
      }
    }
  }
  return largest(albedo);
}

TEST_P(Laws, EnergyIsAsClaimed) {
  if (info_.kind != ModelKind::brdf) GTEST_SKIP() << "no BRDF over the upper hemisphere";
  // A violation has to be told from the quadrature's own error.
  constexpr double tolerance = 1e-3;
  double worst = 0.0;
  std::string place;
  for (std::vector<double> flat : parameter_sets(model_.parameters)) {
    for (const ParameterInfo& info : model_.parameters) {
      if (info.name == "albedo") std::fill_n(flat.begin() + info.offset, info.components, 1.0);
    }
    for (const double cosine_o : {1.0, 0.9, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02}) {
      const double albedo = directional_albedo(model_, flat, cosine_o);
      if (albedo > worst) worst = albedo, place = "parameters " + text(flat) + ", N.V = " + number_text(cosine_o);
    }
  }
  RecordProperty("largest_directional_albedo", number_text(worst));
  if (info_.energy_conserving) {
    EXPECT_LE(worst, 1.0 + tolerance) << place;
  } else {
    EXPECT_GT(worst, 1.0 + tolerance) << "the model conserves energy and could say so";
  }
}

TEST_P(Laws, BatchesEqualSingleEvaluations) {
  const std::vector<DirectionPair> pairs = random_pairs(100, 3);
  std::vector<Direction> wi, wo;
  for (const DirectionPair& pair : pairs) wi.push_back(pair.wi), wo.push_back(pair.wo);
  std::vector<Rgb> values(pairs.size());
  const std::vector<double> flat = interior_parameters(model_.parameters, 1, 0.1, 4)[0];
  model_.evaluate_all(flat, wi, wo, values);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_EQ(channels(values[i]), channels(model_.evaluate(flat, wi[i], wo[i])));
  }
}

TEST_P(Laws, FloatStaysNearDouble) {
  std::vector<DirectionPair> pairs = with_light_behind(info_, random_pairs(1 << 16, 5));
  const std::size_t random_count = pairs.size();
  const std::vector<DirectionPair> hostile = with_light_behind(info_, hostile_pairs());
  pairs.insert(pairs.end(), hostile.begin(), hostile.end());
  const std::size_t count = pairs.size();
  FloatPairs float_pairs(count);
  for (std::size_t i = 0; i < count; ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
  FloatRgb values(count);

  double worst_relative = 0.0, worst_ratio = 0.0;
  int conditioned = 0;
  std::string place;
  std::vector<std::vector<double>> sets = interior_parameters(model_.parameters, 4, 0.0, 6);
  sets.push_back(to_vector(model_.defaults().flat()));
  for (std::vector<double>& flat : sets) {
    const std::vector<float> float_flat(flat.begin(), flat.end());
    // Both scalars start from the same rounded inputs: what is left is the arithmetic's own error.
    flat.assign(float_flat.begin(), float_flat.end());
    float_model_.evaluate(float_flat, float_pairs, 0, count, values);
    for (std::size_t i = 0; i < count; ++i) {
      const Direction wi = float_pairs.wi(i), wo = float_pairs.wo(i);
      const auto truth = channels(model_.evaluate(flat, wi, wo));
      const std::array<double, 3> value{values.r[i], values.g[i], values.b[i]};
      for (std::size_t k = 0; k < 3; ++k) {
        const double error = std::abs(value[k] - truth[k]);
        if (i < random_count && truth[k] > 1e-2) worst_relative = std::max(worst_relative, error / truth[k]);
        double bound = 1e-5 * std::abs(truth[k]) + 1e-6;
        if (error > bound) {
          bound += float_conditioning(model_, flat, wi, wo)[k];
          ++conditioned;
        }
        if (error / bound > worst_ratio) {
          worst_ratio = error / bound;
          place = number_text(value[k]) + " for " + number_text(truth[k]) + ", " + where(flat, wi, wo);
        }
      }
    }
  }
  RecordProperty("worst_relative_error", number_text(worst_relative));
  RecordProperty("worst_error_over_bound", number_text(worst_ratio));
  RecordProperty("values_bounded_by_their_conditioning", conditioned);
  EXPECT_LE(worst_ratio, 1.0) << place;
}

TEST_P(Laws, FloatBatchesDoNotDependOnTheirCuts) {
  // Blocks of any length: the vectorised body and the loop's remainder have to agree to the last bit.
  constexpr std::size_t count = 257;
  const std::vector<DirectionPair> pairs = random_pairs(count, 7);
  FloatPairs float_pairs(count);
  for (std::size_t i = 0; i < count; ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
  FloatRgb whole(count), pieces(count);
  const std::vector<double> flat = interior_parameters(model_.parameters, 1, 0.1, 8)[0];
  const std::vector<float> float_flat(flat.begin(), flat.end());
  float_model_.evaluate(float_flat, float_pairs, 0, count, whole);
  std::size_t begin = 0;
  for (std::size_t length = 1; begin < count; ++length) {
    const std::size_t end = std::min(begin + length, count);
    float_model_.evaluate(float_flat, float_pairs, begin, end, pieces);
    begin = end;
  }
  EXPECT_EQ(whole.r, pieces.r);
  EXPECT_EQ(whole.g, pieces.g);
  EXPECT_EQ(whole.b, pieces.b);
}

/// Runs its tests on the text of one model.
template <class M>
class TextLaws : public ::testing::Test {};
TYPED_TEST_SUITE(TextLaws, AllModels, ModelTypeName);

TYPED_TEST(TextLaws, EveryInstructionSetGivesTheSameBits) {
  // Here the text is compiled for the baseline instruction set, in the float room for the best that this CPU has.
  constexpr std::size_t count = 4096;
  std::vector<DirectionPair> pairs = random_pairs(count, 9);
  const std::vector<DirectionPair> hostile = hostile_pairs();
  pairs.insert(pairs.end(), hostile.begin(), hostile.end());
  pairs = with_light_behind(TypeParam::info, pairs);
  FloatPairs float_pairs(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
  FloatRgb values(pairs.size());
  for (const std::vector<double>& flat : parameter_sets(describe_parameters<TypeParam>())) {
    const std::vector<float> float_flat(flat.begin(), flat.end());
    find_float_model(TypeParam::info.name).evaluate(float_flat, float_pairs, 0, pairs.size(), values);
    const auto p = unflatten<TypeParam, Single>(std::span<const float>(float_flat));
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const Vec3<Single> wi{Single(float_pairs.wi_x[i]), Single(float_pairs.wi_y[i]), Single(float_pairs.wi_z[i])};
      const Vec3<Single> wo{Single(float_pairs.wo_x[i]), Single(float_pairs.wo_y[i]), Single(float_pairs.wo_z[i])};
      const Vec3<Single> value = evaluate_brdf<TypeParam>(p, wi, wo);
      const auto bits = [](float x) { return std::bit_cast<std::uint32_t>(x); };
      ASSERT_EQ(bits(value.x.value), bits(values.r[i])) << where(flat, pairs[i].wi, pairs[i].wo);
      ASSERT_EQ(bits(value.y.value), bits(values.g[i])) << where(flat, pairs[i].wi, pairs[i].wo);
      ASSERT_EQ(bits(value.z.value), bits(values.b[i])) << where(flat, pairs[i].wi, pairs[i].wo);
    }
  }
}

TYPED_TEST(TextLaws, GradientsAreFiniteOnHostileDirections) {
  constexpr int width = 16;
  for (const std::vector<double>& flat : parameter_sets(describe_parameters<TypeParam>())) {
    for (std::size_t first = 0; first < flat.size(); first += width) {
      std::vector<Dual<width>> slots(flat.begin(), flat.end());
      for (std::size_t k = first; k < std::min(first + width, flat.size()); ++k) {
        slots[k] = Dual<width>::variable(flat[k], static_cast<int>(k - first));
      }
      const auto p = unflatten<TypeParam, Dual<width>>(std::span<const Dual<width>>(slots));
      for (const auto& [wi, wo] : with_light_behind(TypeParam::info, hostile_pairs())) {
        const Vec3<Dual<width>> value = evaluate_brdf<TypeParam>(p, wi, wo);
        for (const Dual<width>& channel : {value.x, value.y, value.z}) {
          ASSERT_TRUE(std::isfinite(channel.value)) << where(flat, wi, wo);
          for (std::size_t k = 0; k < width; ++k) {
            ASSERT_TRUE(std::isfinite(channel.derivative[k])) << "slot " << first + k << ", " << where(flat, wi, wo);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace lobefit
