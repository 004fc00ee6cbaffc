// Exported texts that ran somewhere, held against the models in double.
#pragma once

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <functional>
#include <string>
#include <vector>

#include "evaluate/check.h"
#include "evaluate/conditioning.h"
#include "evaluate/shader.h"
#include "tests/directions.h"

namespace lobefit {

/// Lines "  p.NAME = ...;" that read a model's parameters from an array `flat`; `vector` is the language's constructor.
inline std::string read_parameters(const Model& model, const std::string& vector) {
  std::string lines;
  for (const ParameterInfo& info : model.parameters) {
    const auto component = [&](int k) {
      return "flat[" + std::to_string(info.offset + static_cast<std::size_t>(k)) + "]";
    };
    lines += "  p." + std::string(info.name) + " = " +
             (info.components == 3 ? vector + "(" + component(0) + ", " + component(1) + ", " + component(2) + ")"
                                   : component(0)) +
             ";\n";
  }
  return lines;
}

/// A model's text with its initial values.
inline std::string model_text(const Model& model, const std::string& language) {
  std::vector<ShaderParameter> parameters;
  for (const ParameterInfo& info : model.parameters) {
    parameters.push_back({info, std::vector<double>(static_cast<std::size_t>(info.components), info.initial), ""});
  }
  return print_shader(find_float_model(model.info->name).trace(), language, *model.info, parameters, {});
}

/// Random pairs and hostile ones, rounded to float; those of fibres point everywhere.
inline std::vector<float> float_pairs(std::size_t count, bool sphere) {
  std::vector<DirectionPair> pairs = hostile_pairs();
  // What check's own pairs go down to: below, 1/cos leaves the range of floats.
  std::erase_if(pairs, [](const DirectionPair& pair) { return std::min(pair.wi.z, pair.wo.z) < 9e-7; });
  const std::vector<DirectionPair> random = random_pairs(count - pairs.size(), 91);
  pairs.insert(pairs.end(), random.begin(), random.end());
  std::vector<float> result;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (sphere && (i + i / 64) % 2 == 1) pairs[i].wi.z = -pairs[i].wi.z;
    for (const Direction& w : {pairs[i].wi, pairs[i].wo}) {
      for (const double x : {w.x, w.y, w.z}) result.push_back(static_cast<float>(x));
    }
  }
  return result;
}

struct Agreement {
  std::size_t failures = 0, conditioned = 0;
  double worst = 0.0;  // error over bound
  std::string where;
};

/// Values, three for each of `count` pairs, of a compiled text with parameters `flat`.
using ShaderBatch = std::function<void(const float* flat, const float* pairs, long count, float* values)>;

/// Holds a compiled text against the model in double, by the bounds of `lobefit check`: both see the same floats.
inline Agreement agreement(const Model& model, const ShaderBatch& evaluate, std::span<const ParameterValues> sets,
                           std::span<const float> pairs) {
  const CheckOptions bounds;
  const std::size_t count = pairs.size() / 6;
  const bool hair = is_hair(model.info->kind);
  Agreement result;
  for (const ParameterValues& set : sets) {
    std::vector<float> flat;
    for (const double value : set.flat()) flat.push_back(static_cast<float>(value));
    const std::vector<double> wide(flat.begin(), flat.end());
    std::vector<float> values(3 * count);
    evaluate(flat.data(), pairs.data(), static_cast<long>(count), values.data());
    std::vector<double> excess(count);
    std::vector<std::uint8_t> conditioned(count);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      const float* x = pairs.data() + 6 * i;
      const Direction wi{x[0], x[1], x[2]}, wo{x[3], x[4], x[5]};
      const Rgb f = model.evaluate(wide, wi, wo);
      const std::array<double, 3> truth{f.x, f.y, f.z};
      for (std::size_t c = 0; c < 3; ++c) {
        const double error = std::abs(values[3 * i + c] - truth[c]);
        double bound =
            bounds.relative_bound * std::abs(truth[c]) + bounds.absolute_bound / (hair ? 1.0 : std::abs(wi.z));
        if (!(error <= bound)) {
          bound += float_conditioning(model, wide, wi, wo)[c];
          conditioned[i] = 1;
        }
        excess[i] = std::max(excess[i], std::isfinite(error) ? error / bound : INFINITY);
      }
    });
    for (std::size_t i = 0; i < count; ++i) {
      if (excess[i] > 1.0) ++result.failures;
      if (conditioned[i] != 0 && excess[i] <= 1.0) ++result.conditioned;
      if (excess[i] <= result.worst) continue;
      result.worst = excess[i];
      result.where = "wi";
      for (std::size_t k = 0; k < 6; ++k) result.where += " " + std::to_string(pairs[6 * i + k]);
      for (const ParameterInfo& info : model.parameters) {
        result.where += ", " + std::string(info.name) + " " + set.text(info);
      }
    }
  }
  return result;
}

inline std::vector<ParameterValues> parameter_sets(const Model& model, int count) {
  std::vector<std::string> names;
  for (const ParameterInfo& info : model.parameters) names.emplace_back(info.name);
  return varied_parameters(model.defaults(), names, count, 92);
}

}  // namespace lobefit
