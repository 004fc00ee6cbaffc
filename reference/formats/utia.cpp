#include "reference/formats/utia.h"

#include "reference/formats/byte_reader.h"
#include "reference/srgb.h"

namespace lobefit {

Table Utia::parse(std::string_view bytes, Scale scale, const std::string& place) {
  ByteReader reader(bytes, place);
  if (bytes.size() != file_size) {
    throw reader.error(
        "not a UTIA table: " + std::to_string(bytes.size()) + " bytes instead of " + std::to_string(file_size), 0);
  }
  const auto decode = [&](double value) {
    if (scale == Scale::raw) return value;
    return 100.0 * srgb_decode(value / 140.0);
  };
  Table table;
  table.coordinates = Coordinates::list;
  table.grid = {.theta_i = {"phi_i", "degree", {}, false},
                .theta_o = {"theta_i", "degree", {}, false},
                .phi = {"view", "", {}, false}};
  for (std::size_t k = 0; k < thetas; ++k) table.grid.theta_o.values.push_back(15.0 * static_cast<double>(k));
  for (std::size_t k = 0; k < phis; ++k) table.grid.theta_i.values.push_back(7.5 * static_cast<double>(k));
  for (std::size_t k = 0; k < directions; ++k) table.grid.phi.values.push_back(static_cast<double>(k));
  table.channels = 3;
  table.allocate();
  const auto angles = [](std::size_t k) {
    return direction(radians(15.0 * static_cast<double>(k / phis)), radians(7.5 * static_cast<double>(k % phis)));
  };
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const Direction wi = angles(entry / directions), wo = angles(entry % directions);
    table.set_directions(entry, wi, wo);
    // Steps are equal but for the rings at 0, which stand for half a step.
    const auto ring = [](std::size_t k) { return k / phis == 0 ? 0.5 : 1.0; };
    const double step = radians(15.0) * radians(7.5);
    table.measure[entry] = static_cast<float>(measured_sine(wi) * measured_sine(wo) * step * step *
                                              ring(entry / directions) * ring(entry % directions));
  }
  for (std::size_t k = 0; k < table.values.size(); ++k) {
    const std::size_t at = reader.offset();
    const auto stored = reader.number<double>("a value");
    if (!std::isfinite(stored)) throw reader.error("a value is not finite", at);
    if (stored < 0.0) table.valid[k % table.entries()] = 0;
    table.values[k] = to_float(stored < 0.0 ? 0.0 : decode(stored));
  }
  table.model = "measured";
  table.parameters = {{"format", "utia"}, {"scale", scale == Scale::raw ? "raw" : "srgb"}, {"isotropic", false}};
  table.method = "measured";
  table.mask_what_is_not_finite(0, table.entries());
  return table;
}

}  // namespace lobefit
