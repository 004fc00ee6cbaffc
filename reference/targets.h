// Exact functions that published closed forms stand for: what refits of their constants aim at.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "models/parameter.h"

namespace lobefit {

struct Target {
  std::string name, title, source;
  std::vector<ParameterInfo> arguments;  // with ranges and defaults
  std::function<double(std::span<const double> arguments)> evaluate;
  /// Further arguments of forms, that follow from its own, in this order.
  std::vector<std::string> derived_names;
  std::function<std::vector<double>(std::span<const double> arguments)> derive;

  /// Index among `arguments`; -1 if it is none.
  int find(std::string_view argument) const;
};

const std::vector<Target>& targets();
/// Throws Error(usage) with the nearest name.
const Target& find_target(const std::string& name);

}  // namespace lobefit
