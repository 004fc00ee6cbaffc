// Rows of a table by the values of its parameter axes.
#pragma once

#include <span>
#include <string>

#include "reference/table.h"

namespace lobefit {

struct AxisValue {
  std::string axis;
  double value;
};

/// The parameter row at these values; axes of a single value need none. Throws Error(usage) where an axis or a value is
/// not the table's, or one is missing.
std::size_t find_row(const Table& table, std::span<const AxisValue> wanted);

}  // namespace lobefit
