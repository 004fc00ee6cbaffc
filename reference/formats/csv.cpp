// Tables as comma-separated values.
#include <fmt/format.h>

#include "reference/formats/alta.h"

namespace lobefit {

std::string table_csv(const Table& table) {
  std::string result;
  for (const Axis& axis : table.parameter_axes) result += axis.name + ",";
  result += table.channels == 1 ? "theta_i,phi_i,theta_o,phi_o,f\n" : "theta_i,phi_i,theta_o,phi_o,r,g,b\n";
  const bool spherical = table.coordinates == Coordinates::spherical;
  const auto polar = [](const Direction& w) { return degrees(std::atan2(std::hypot(w.x, w.y), w.z)); };
  const auto azimuth = [](const Direction& w) { return degrees(std::atan2(w.y, w.x)); };
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (!table.valid[entry]) continue;
    for (const double value : table.parameter_values(table.parameter_row(entry))) result += fmt::format("{},", value);
    if (spherical) {
      result += fmt::format("{},{},{},0", table.grid.theta_i.values[table.theta_i_index(entry)],
                            table.grid.phi.values[table.phi_index(entry)],
                            table.grid.theta_o.values[table.theta_o_index(entry)]);
    } else {
      const Direction wi = table.wi(entry), wo = table.wo(entry);
      result += fmt::format("{},{},{},{}", polar(wi), azimuth(wi), polar(wo), azimuth(wo));
    }
    for (int c = 0; c < table.channels; ++c) result += fmt::format(",{}", table.value(entry, c));
    result += '\n';
  }
  return result;
}

}  // namespace lobefit
