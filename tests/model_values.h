// Registered models at some parameters, as tests ask for them.
#pragma once

#include <array>
#include <initializer_list>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "models/registry.h"

namespace lobefit {

using Parameters = std::initializer_list<std::pair<std::string_view, double>>;

inline std::vector<double> flat_of(std::string_view name, Parameters parameters) {
  ParameterValues values = find_model(name).defaults();
  for (const auto& [parameter, value] : parameters) values.set(parameter, value);
  return {values.flat().begin(), values.flat().end()};
}

/// The first channel.
inline double value(std::string_view name, Parameters parameters, const Direction& wi, const Direction& wo) {
  return find_model(name).evaluate(flat_of(name, parameters), wi, wo).x;
}

/// A model and its parameters, in colour.
class Material {
 public:
  explicit Material(std::string_view name, Parameters parameters = {})
      : model_(find_model(name)), values_(model_.defaults()) {
    for (const auto& [parameter, value] : parameters) values_.set(parameter, value);
  }
  Material& set(std::string_view parameter, double value) {
    values_.set(parameter, value);
    return *this;
  }
  Material& color(std::string_view parameter, std::array<double, 3> rgb) {
    values_.set(parameter, std::span<const double>(rgb));
    return *this;
  }
  Rgb operator()(const Direction& wi, const Direction& wo) const { return model_.evaluate(values_.flat(), wi, wo); }
  const Model& model() const { return model_; }
  std::span<const double> flat() const { return values_.flat(); }

 private:
  const Model& model_;
  ParameterValues values_;
};

}  // namespace lobefit
