// The models as a GPU runs them: float batches over structure-of-arrays directions, and shaders.
#pragma once

#include <deque>
#include <span>
#include <string_view>
#include <vector>

#include "evaluate/expression.h"
#include "evaluate/single.h"
#include "models/registry.h"

namespace lobefit {

/// Pairs of directions in float, one array per component.
struct FloatPairs {
  std::vector<float> wi_x, wi_y, wi_z, wo_x, wo_y, wo_z;

  explicit FloatPairs(std::size_t n = 0) : wi_x(n), wi_y(n), wi_z(n), wo_x(n), wo_y(n), wo_z(n) {}
  std::size_t size() const { return wi_x.size(); }
  void set(std::size_t i, const Direction& wi, const Direction& wo) {
    wi_x[i] = static_cast<float>(wi.x), wi_y[i] = static_cast<float>(wi.y), wi_z[i] = static_cast<float>(wi.z);
    wo_x[i] = static_cast<float>(wo.x), wo_y[i] = static_cast<float>(wo.y), wo_z[i] = static_cast<float>(wo.z);
  }
  Direction wi(std::size_t i) const { return {wi_x[i], wi_y[i], wi_z[i]}; }
  Direction wo(std::size_t i) const { return {wo_x[i], wo_y[i], wo_z[i]}; }
};

struct FloatRgb {
  std::vector<float> r, g, b;

  explicit FloatRgb(std::size_t n = 0) : r(n), g(n), b(n) {}
};

struct FloatModel {
  std::string_view name;
  /// BRDFs of pairs [begin, end) of `pairs`, parameters rounded to float.
  void (*evaluate)(std::span<const float> flat, const FloatPairs& pairs, std::size_t begin, std::size_t end,
                   FloatRgb& values);
  Shader (*trace)();
};

/// In the order of models().
const std::deque<FloatModel>& float_models();
/// Beside add_model(), for the same name.
void add_float_model(const FloatModel& model);
/// Throws Error(usage) for an unknown name.
const FloatModel& find_float_model(std::string_view name);

}  // namespace lobefit
