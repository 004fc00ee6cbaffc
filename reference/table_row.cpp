#include "reference/table_row.h"

#include <algorithm>
#include <cmath>

#include "models/parameter.h"

namespace lobefit {

std::size_t find_row(const Table& table, std::span<const AxisValue> wanted) {
  std::vector<std::size_t> index(table.parameter_axes.size(), 0);
  std::vector<bool> set(table.parameter_axes.size(), false);
  for (const AxisValue& at : wanted) {
    const auto axis = std::ranges::find(table.parameter_axes, at.axis, &Axis::name);
    if (axis == table.parameter_axes.end()) {
      throw Error(ExitCode::usage, "the table has no axis '" + at.axis + "'", "--set",
                  "`lobefit table info` lists its axes");
    }
    const auto found = std::ranges::find_if(
        axis->values, [&](double v) { return std::abs(v - at.value) <= 1e-9 * std::max(1.0, std::abs(v)); });
    if (found == axis->values.end()) {
      throw Error(ExitCode::usage, "the table has no row at " + at.axis + "=" + number_text(at.value), "--set",
                  "choose one of the axis' values: `lobefit table info` lists them");
    }
    const auto number = static_cast<std::size_t>(axis - table.parameter_axes.begin());
    index[number] = static_cast<std::size_t>(found - axis->values.begin());
    set[number] = true;
  }
  std::size_t row = 0;
  for (std::size_t i = 0; i < index.size(); ++i) {
    const Axis& axis = table.parameter_axes[i];
    if (!set[i] && axis.size() > 1) {
      throw Error(ExitCode::usage, "which " + axis.name + "?", "--set",
                  "the table has an axis of it: add --set " + axis.name + "=VALUE");
    }
    row = row * axis.size() + index[i];
  }
  return row;
}

}  // namespace lobefit
