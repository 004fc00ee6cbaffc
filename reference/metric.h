// How far two BRDFs are apart: a quantity, weights over the grid, and their mean square.
#pragma once

#include <array>
#include <cmath>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "reference/table.h"

namespace lobefit {

/// The quantity in which differences are taken; c = cos theta_i.
enum class Quantity {
  cosine,     // π f c: what reaches the eye per unit irradiance at normal incidence (Ngan 2005)
  brdf,       // π f
  log,        // log(1 + f c) (Low 2012)
  cube_root,  // (f c)^⅓ (Fores 2012)
};
inline constexpr std::array<std::string_view, 4> quantity_names{"cosine", "brdf", "log", "cube_root"};
/// Throws Error(usage) with the choices.
Quantity parse_quantity(std::string_view name);

struct ValueAndSlope {
  double value, slope;  // slope: derivative by f
};
ValueAndSlope transform(Quantity quantity, double f, double cos_theta_i);

/// A weight per table entry as a product of named factors; none means 1.
enum class WeightFactor {
  sin_theta_i,
  sin_theta_o,
  cos_theta_i,
  cos_theta_o,
  quadrature,        // the axes' own quadrature weights
  inverse_variance,  // 1/stderr² of the quantity
};
inline constexpr std::array<std::string_view, 6> weight_factor_names{"sin_theta_i", "sin_theta_o", "cos_theta_i",
                                                                     "cos_theta_o", "quadrature",  "inverse_variance"};
inline std::vector<std::string_view> weight_names(const std::vector<WeightFactor>& weights) {
  std::vector<std::string_view> names;
  for (const WeightFactor factor : weights) names.push_back(weight_factor_names[static_cast<std::size_t>(factor)]);
  return names;
}
/// From "uniform" or names separated by commas; a name may repeat. Throws Error(usage).
std::vector<WeightFactor> parse_weights(std::string_view text);

/// Weights of all entries of one channel, 0 where masked; they sum to 1. Throws Error(invalid_input) if every entry is
/// masked, or if inverse_variance meets an entry without error.
std::vector<double> entry_weights(const Table& table, const std::vector<WeightFactor>& factors, Quantity quantity);

/// Root of the weighted mean square of quantity(values) - quantity(table) over all channels; values as in
/// Table::values.
double rms_difference(const Table& table, std::span<const float> values, Quantity quantity,
                      const std::vector<double>& weights);

/// rms_difference() of every quantity, in one pass.
using QuantityErrors = std::array<double, quantity_names.size()>;
QuantityErrors rms_differences(const Table& table, std::span<const float> values, const std::vector<double>& weights);

}  // namespace lobefit
