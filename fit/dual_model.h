// Models with derivatives: values and Jacobians in vectorised passes of sixteen variables.
#pragma once

#include <span>
#include <string_view>

#include "fit/dual.h"
#include "models/registry.h"

namespace lobefit {

/// Derivatives carried in one pass.
inline constexpr int dual_width = 16;

struct DualModel {
  std::string_view name;
  /// Values and derivatives at n pairs. `variable_of_slot[s]` is the variable that drives slot s of `flat`, or -1;
  /// only variables [first, first + 16) are differentiated. values[c n + i], derivatives[(c n + i) 16 + k].
  void (*evaluate)(std::span<const double> flat, std::span<const int> variable_of_slot, int first,
                   std::span<const Direction> wi, std::span<const Direction> wo, int channels, double* values,
                   double* derivatives);
};

/// Beside add_model(), for the same name.
void add_dual_model(const DualModel& model);
/// The room's model of the same name. Throws Error(usage) if it has none.
const DualModel& dual_model(const Model& model);

}  // namespace lobefit
