// The laws of reflection, held against every registered model: a line in models/list.def is all that a new model needs.

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <fstream>
#include <numeric>
#include <sstream>
#include <string>

#include "evaluate/conditioning.h"
#include "evaluate/float_model.h"
#include "fit/dual_model.h"
#include "models/registry.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/model_types.h"
#include "tests/sphere_sampling.h"

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

/// Each parameter swept while one other is at an end of its range: where one part of a model hides another, a trouble
/// needs two parameters.
std::vector<std::vector<double>> pairwise_sets(const std::vector<ParameterInfo>& list) {
  std::vector<std::vector<double>> sets;
  constexpr int steps = 24;
  for (const ParameterInfo& info : list) {
    for (const ParameterInfo& other : list) {
      if (&other == &info) continue;
      for (const double end : {other.lower, other.upper}) {
        for (int step = 0; step <= steps; ++step) {
          std::vector<double> flat = to_vector(ParameterValues(list, "").flat());
          std::fill_n(flat.begin() + info.offset, info.components,
                      info.lower + (info.upper - info.lower) * step / steps);
          std::fill_n(flat.begin() + other.offset, other.components, end);
          sets.push_back(flat);
        }
      }
    }
  }
  return sets;
}

/// For fibres and models that transmit, each pair again with its light on the other side.
std::vector<DirectionPair> where_defined(const ModelInfo& info, std::vector<DirectionPair> pairs) {
  if (!is_hair(info.kind) && !info.transmits) return pairs;
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

/// Laws of some models only.
class SurfaceLaws : public Laws {};
class BrdfLaws : public Laws {};
class FibreLaws : public Laws {};
class TermLaws : public Laws {};
class SamplingLaws : public Laws {};

template <class Condition>
auto models_where(Condition&& condition) {
  std::vector<std::string> names;
  for (const Model& model : models()) {
    if (condition(model)) names.emplace_back(model.info->name);
  }
  return ::testing::ValuesIn(names);
}
std::string model_name(const ::testing::TestParamInfo<std::string>& test) { return test.param; }

INSTANTIATE_TEST_SUITE_P(Models, Laws, models_where([](const Model&) { return true; }), model_name);
INSTANTIATE_TEST_SUITE_P(Models, SurfaceLaws, models_where([](const Model& m) { return !is_hair(m.info->kind); }),
                         model_name);
INSTANTIATE_TEST_SUITE_P(Models, BrdfLaws, models_where([](const Model& m) { return m.info->kind == ModelKind::brdf; }),
                         model_name);
INSTANTIATE_TEST_SUITE_P(Models, FibreLaws,
                         models_where([](const Model& m) { return m.info->kind == ModelKind::hair; }), model_name);
INSTANTIATE_TEST_SUITE_P(Models, TermLaws, models_where([](const Model& m) { return is_term(m.info->kind); }),
                         model_name);
INSTANTIATE_TEST_SUITE_P(Models, SamplingLaws, models_where([](const Model& m) { return m.sample != nullptr; }),
                         model_name);

TEST_P(Laws, StandInTheDocument) {
  std::ostringstream document;
  document << std::ifstream(LOBEFIT_DOCS "/laws.md").rdbuf();
  EXPECT_NE(document.str().find("| `" + GetParam() + "` |"), std::string::npos) << "scripts/laws writes docs/laws.md";
}

TEST_P(Laws, RoomsAgreeOnNames) { EXPECT_EQ(float_model_.name, info_.name); }

TEST_P(Laws, SignIsAsClaimed) {
  std::vector<DirectionPair> pairs = random_pairs(1000, 1);
  const std::vector<DirectionPair> hostile = hostile_pairs();
  pairs.insert(pairs.end(), hostile.begin(), hostile.end());
  pairs = where_defined(info_, pairs);
  FloatPairs float_pairs(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
  FloatRgb values(pairs.size());

  double worst = 0.0, worst_in_float = 0.0;
  std::string place, place_in_float;
  const auto search = [&](const std::vector<std::vector<double>>& sets) {
    for (const std::vector<double>& flat : sets) {
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
  };
  search(parameter_sets(model_.parameters));
  // Who says that it may be negative must be caught; the wider search is for those who are so in a corner only.
  if (!info_.non_negative && worst >= -1e-3) search(pairwise_sets(model_.parameters));
  RecordProperty("law_smallest_value", number_text(worst));
  RecordProperty("smallest_value_in_float", number_text(worst_in_float));
  if (info_.non_negative) {
    EXPECT_GE(worst, 0.0) << place;
    EXPECT_GE(worst_in_float, 0.0) << place_in_float;
  } else {
    EXPECT_LT(worst, -1e-3) << "the model is never negative and could say so";
  }
}

TEST_P(SurfaceLaws, NothingIsReflectedBelowTheHorizon) {
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

TEST_P(TermLaws, AreGrey) {
  for (const std::vector<double>& flat : interior_parameters(model_.parameters, 4, 0.0, 13)) {
    for (const auto& [wi, wo] : random_pairs(20, 14)) {
      const Rgb value = model_.evaluate(flat, wi, wo);
      EXPECT_EQ(value.x, value.y);
      EXPECT_EQ(value.x, value.z);
    }
  }
}

TEST_P(Laws, ValuesAreFiniteOnHostileDirections) {
  const std::vector<DirectionPair> pairs = where_defined(info_, hostile_pairs());
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
    for (const auto& [wi, wo] : where_defined(info_, random_pairs(1000, 2))) {
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
  RecordProperty("law_reciprocity_violation", number_text(worst));
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
    // that are picked by the first number. That number as t² (3 - 2t), whose slope is the weight 6t (1 - t): the
    // lattice is for periodic integrands, and more points next to grazing resolve what rises there.
    constexpr int count = 2584, generator = 1597;
    for (int i = 0; i < count; ++i) {
      const double t = (i + 0.5) / count;
      const Direction wi = model.sample(flat, wo, {t * t * (3.0 - 2.0 * t), (i * generator % count + 0.5) / count});
      if (wi.z <= 0.0 && !model.info->transmits) continue;
      const double weight = 6.0 * t * (1.0 - t) / (model.pdf(flat, wi, wo) * count);
      albedo = albedo + model.evaluate(flat, wi, wo) * (std::abs(wi.z) * weight);
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

/// ∫ S dω of a fibre for a view at inclination `sin_theta_v`, the largest of the three channels: S wants no cosine.
double fibre_albedo(const Model& model, std::span<const double> flat, double sin_theta_v) {
  constexpr int panels = 64, azimuths = 64;
  const Direction wo{std::sqrt((1.0 - sin_theta_v) * (1.0 + sin_theta_v)), 0.0, sin_theta_v};
  Rgb albedo{};
  for (int panel = 0; panel < panels; ++panel) {
    for (const auto& [theta, weight] : gauss_legendre(8, pi * panel / panels, pi * (panel + 1) / panels)) {
      for (int k = 0; k < azimuths; ++k) {
        const Direction wi = direction(theta, 2.0 * pi * (k + 0.5) / azimuths);
        albedo = albedo + model.evaluate(flat, wi, wo) * (std::sin(theta) * weight * 2.0 * pi / azimuths);
      }
    }
  }
  return largest(albedo);
}

/// Default parameters with the colours that scale a model at 1.
std::vector<double> white_defaults(const Model& model) {
  ParameterValues values = model.defaults();
  for (const char* name : {"albedo", "base_color", "color", "diffuse_albedo"}) {
    if (values.has(name)) values.set(name, 1.0);
  }
  return to_vector(values.flat());
}

TEST_P(FibreLaws, EnergyIsAsClaimed) {
  constexpr double tolerance = 1e-3;
  constexpr std::array sines{0.0, 0.5, 0.8, 0.95};
  double worst = 0.0;
  std::string place;
  std::vector<std::vector<double>> sets = interior_parameters(model_.parameters, 8, 0.0, 12);
  for (const double roughness : {0.3, 0.6, 1.0}) {
    ParameterValues values = model_.defaults();
    values.set("roughness", roughness);
    sets.push_back(to_vector(values.flat()));
  }
  for (std::vector<double> flat : sets) {
    for (const ParameterInfo& info : model_.parameters) {
      double& value = flat[static_cast<std::size_t>(info.offset)];
      if (info.name == "base_color") std::fill_n(flat.begin() + info.offset, info.components, 1.0);
      // Narrower lobes fall between the points of the quadrature.
      if (info.name == "roughness") value = std::max(value, 0.3);
    }
    for (const double sin_theta_v : sines) {
      const double albedo = fibre_albedo(model_, flat, sin_theta_v);
      if (albedo > worst) worst = albedo, place = "parameters " + text(flat) + ", sine " + number_text(sin_theta_v);
    }
  }
  double at_defaults = 0.0;
  for (const double sine : sines)
    at_defaults = std::max(at_defaults, fibre_albedo(model_, white_defaults(model_), sine));
  RecordProperty("law_albedo_at_defaults", number_text(at_defaults));
  RecordProperty("law_largest_albedo", number_text(worst));
  if (info_.energy_conserving) {
    EXPECT_LE(worst, 1.0 + tolerance) << place;
  } else {
    EXPECT_GT(worst, 1.0 + tolerance) << "the model conserves energy and could say so";
  }
}

TEST_P(BrdfLaws, EnergyIsAsClaimed) {
  // A violation has to be told from the quadrature's own error.
  constexpr double tolerance = 1e-3;
  constexpr std::array cosines{1.0, 0.9, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02};
  double worst = 0.0;
  std::string place;
  for (std::vector<double> flat : parameter_sets(model_.parameters)) {
    for (const ParameterInfo& info : model_.parameters) {
      if (info.name == "albedo") std::fill_n(flat.begin() + info.offset, info.components, 1.0);
    }
    for (const double cosine_o : cosines) {
      const double albedo = directional_albedo(model_, flat, cosine_o);
      if (albedo > worst) worst = albedo, place = "parameters " + text(flat) + ", N.V = " + number_text(cosine_o);
    }
  }
  double at_defaults = 0.0;
  for (const double cosine_o : cosines) {
    at_defaults = std::max(at_defaults, directional_albedo(model_, white_defaults(model_), cosine_o));
  }
  RecordProperty("law_albedo_at_defaults", number_text(at_defaults));
  RecordProperty("law_largest_albedo", number_text(worst));
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
  std::vector<DirectionPair> pairs = where_defined(info_, random_pairs(1 << 16, 5));
  const std::size_t random_count = pairs.size();
  const std::vector<DirectionPair> hostile = where_defined(info_, hostile_pairs());
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
      // Of hostile pairs in premultiplied form, f cos θ: next to the horizon f itself may be all rounding.
      const bool premultiplied = i >= random_count && !is_hair(info_.kind);
      const double absolute_bound = 1e-6 / (premultiplied ? std::min(std::abs(wi.z), wo.z) : 1.0);
      for (std::size_t k = 0; k < 3; ++k) {
        const double error = std::abs(value[k] - truth[k]);
        if (i < random_count && truth[k] > 1e-2) worst_relative = std::max(worst_relative, error / truth[k]);
        double bound = 1e-5 * std::abs(truth[k]) + absolute_bound;
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
  RecordProperty("law_float_error", number_text(worst_relative));
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

TEST_P(SamplingLaws, SamplesFollowTheirDensity) {
  ASSERT_NE(model_.pdf, nullptr);
  ParameterValues values = model_.defaults();
  // Cells are too large for the quadrature of sharp lobes.
  for (const char* name : {"alpha", "clear_coat_roughness"}) {
    if (values.has(name)) values.set(name, 0.5);
  }
  const SamplingFit found = expect_samples_follow_pdf(model_, values.flat(), direction(radians(50.0), 0.4));
  RecordProperty("law_chi2", number_text(found.chi2));
  RecordProperty("law_cells", std::to_string(found.cells));
}

TEST_P(Laws, DerivativesAreThoseOfTheModel) {
  // Four-point central differences of the model in double; variables straddle the boundary between two passes.
  constexpr std::size_t pairs = 40;
  const DualModel& dual = dual_model(model_);
  ASSERT_EQ(dual.name, info_.name);
  const std::size_t slots = model_.defaults().flat().size();
  std::vector<Direction> wi, wo;
  for (const DirectionPair& pair : random_pairs(pairs, 3)) {
    wi.push_back(pair.wi);
    wo.push_back(pair.wo);
  }
  int tested = 0, kinks = 0;
  double worst = 0.0;
  std::string place;
  for (const std::vector<double>& flat : interior_parameters(model_.parameters, 3, 0.2, 5)) {
    std::vector<int> variable_of_slot(slots);
    std::iota(variable_of_slot.begin(), variable_of_slot.end(), dual_width - 2);
    for (int first = 0; first < static_cast<int>(slots) + dual_width - 2; first += dual_width) {
      std::vector<double> values(3 * pairs), derivatives(3 * pairs * dual_width);
      dual.evaluate(flat, variable_of_slot, first, wi, wo, 3, values.data(), derivatives.data());
      for (std::size_t i = 0; i < pairs; ++i) {
        const auto at = [&](const std::vector<double>& point) {
          return channels(model_.evaluate(point, wi[i], wo[i]));
        };
        const auto here = at(flat);
        for (std::size_t c = 0; c < 3; ++c) {
          // Batches are compiled per instruction set, so their last bits may differ.
          EXPECT_NEAR(values[c * pairs + i], here[c], 1e-13 * std::abs(here[c]));
        }
        for (std::size_t slot = 0; slot < slots; ++slot) {
          const int k = variable_of_slot[slot] - first;
          if (k < 0 || k >= dual_width) continue;
          const auto moved = [&](double by) {
            std::vector<double> point = flat;
            point[slot] += by;
            return at(point);
          };
          // Tables are linear between their entries: where the slope changes within the wide stencil by less than
          // counts as a kink below, a narrow one beside the change finds the derivative.
          std::array<double, 3> errors;
          errors.fill(std::numeric_limits<double>::infinity());
          std::array<bool, 3> smooth{};
          for (const double relative_step : {1e-3, 1e-4}) {
            const double step = relative_step * std::max(0.01, std::abs(flat[slot]));
            const auto far_up = moved(2.0 * step), up = moved(step), down = moved(-step), far_down = moved(-2.0 * step);
            for (std::size_t c = 0; c < 3; ++c) {
              const double narrow = (up[c] - down[c]) / (2.0 * step), wide = (far_up[c] - far_down[c]) / (4.0 * step);
              // Across a kink the two differences disagree; there the derivative is one-sided and not tested.
              if (std::abs(narrow - wide) > 1e-3 * std::abs(narrow) + 1e-6) continue;
              smooth[c] = true;
              const double difference = (4.0 * narrow - wide) / 3.0;
              const double found = derivatives[(c * pairs + i) * dual_width + static_cast<std::size_t>(k)];
              errors[c] = std::min(errors[c], std::abs(found - difference) / std::max(1e-2, std::abs(difference)));
            }
          }
          for (std::size_t c = 0; c < 3; ++c) {
            ++(smooth[c] ? tested : kinks);
            if (smooth[c] && errors[c] > worst) {
              worst = errors[c];
              place = "slot " + std::to_string(slot) + ", " + where(flat, wi[i], wo[i]);
            }
          }
        }
      }
    }
  }
  if (slots > 0) RecordProperty("law_gradient_error", number_text(worst));
  EXPECT_LE(worst, 1e-6) << place;
  EXPECT_LE(10 * kinks, tested);
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
  pairs = where_defined(TypeParam::info, pairs);
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
      for (const auto& [wi, wo] : where_defined(TypeParam::info, hostile_pairs())) {
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
