// A parameter's number or colour as three channels.
#pragma once

#include <array>
#include <string_view>

#include "models/parameter.h"

namespace lobefit {

using Channels = std::array<double, 3>;

inline Channels channels_of(const ParameterValues& values, std::string_view name) {
  const std::span<const double> slots = values.components(values.info(name));
  return slots.size() == 1 ? Channels{slots[0], slots[0], slots[0]} : Channels{slots[0], slots[1], slots[2]};
}

inline bool is_grey(const Channels& c) { return c[0] == c[1] && c[0] == c[2]; }

/// Exactly the number itself where all three are it.
inline double mean(const Channels& c) { return is_grey(c) ? c[0] : (c[0] + c[1] + c[2]) / 3.0; }

}  // namespace lobefit
