// How a shader's parameter is stored in few bits: binary16, or codes laid evenly (or by sRGB's curve) over its range.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>

#include "models/parameter.h"
#include "models/substrate/storage.h"

namespace lobefit {

inline constexpr double largest_half = 65504.0;

struct ParameterCode {
  std::string_view name;
  std::array<int, 3> bits;                  // of each component; a single number takes the first
  std::optional<StorageEncoding> encoding;  // none: IEEE 754 binary16, whatever the range
  std::string_view doc;

  int bit_count(const ParameterInfo& info) const {
    return info.components == 3 ? bits[0] + bits[1] + bits[2] : bits[0];
  }
  /// What is read back of one component of a parameter: of the nearest code. Beyond binary16 its largest number.
  double decoded(double value, const ParameterInfo& info, int component) const;
};

/// All of them; the help lists them.
std::span<const ParameterCode> parameter_codes();
/// Throws Error(usage) with the choices.
const ParameterCode& find_parameter_code(std::string_view name);

}  // namespace lobefit
