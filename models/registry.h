// All models by name, in double precision.
#pragma once

#include <array>
#include <deque>
#include <span>
#include <string_view>
#include <vector>

#include "models/model.h"

namespace lobefit {

/// A registered model: the formula's truth. Values are BRDFs in 1/sr, without cosine.
struct Model {
  const ModelInfo* info;
  std::vector<ParameterInfo> parameters;
  /// Value at one pair of unit directions; `flat` are the parameters in the order of `parameters`.
  Rgb (*evaluate)(std::span<const double> flat, const Direction& wi, const Direction& wo);
  /// The same over n pairs.
  void (*evaluate_all)(std::span<const double> flat, std::span<const Direction> wi, std::span<const Direction> wo,
                       std::span<Rgb> values);
  /// A direction to the light for a viewer at wo, from u in [0, 1)²: with density pdf() per solid angle. Null where a
  /// model has no sampling of its own. Directions below the horizon come out too; nothing is reflected there.
  Direction (*sample)(std::span<const double> flat, const Direction& wo, const std::array<double, 2>& u) = nullptr;
  double (*pdf)(std::span<const double> flat, const Direction& wi, const Direction& wo) = nullptr;

  ParameterValues defaults() const { return ParameterValues(parameters, std::string(info->name)); }
};

/// Every registered model: those of list.def in its order, then what add_model() added. References stay valid.
const std::deque<Model>& models();
/// Registers a model that is not in list.def (make_model() makes one). Before other threads use the registry. Throws
/// Error(usage) if the name is taken.
void add_model(const Model& model);
/// Throws Error(usage) with the nearest name.
const Model& find_model(std::string_view name);

}  // namespace lobefit
