#include "reference/formats/merl.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "reference/formats/byte_reader.h"

namespace lobefit {

namespace {

constexpr std::array<double, 3> scales{1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0};
constexpr std::size_t header_size = 3 * sizeof(std::int32_t);

}  // namespace

Merl Merl::parse(std::string_view bytes, const std::string& place) {
  ByteReader reader(bytes, place);
  std::array<std::int32_t, 3> dimensions;
  for (std::int32_t& dimension : dimensions) dimension = reader.number<std::int32_t>("the dimensions");
  if (dimensions != std::array<std::int32_t, 3>{theta_h_bins, theta_d_bins, phi_d_bins}) {
    throw reader.error("not a MERL table: dimensions " + std::to_string(dimensions[0]) + ", " +
                           std::to_string(dimensions[1]) + ", " + std::to_string(dimensions[2]) +
                           " instead of 90, 90, 180",
                       0);
  }
  const std::string_view data = reader.take(3 * bins * sizeof(double), "the table");
  if (reader.offset() != bytes.size()) throw reader.error("the table ends here, the file goes on");
  Merl result;
  result.values.resize(3 * bins);
  std::memcpy(result.values.data(), data.data(), data.size());
  bool any = false;
  for (std::size_t k = 0; k < result.values.size(); ++k) {
    if (!std::isfinite(result.values[k])) {
      throw reader.error("a value is not finite", header_size + k * sizeof(double));
    }
    any = any || result.values[k] >= 0.0;
    result.values[k] *= scales[k / bins];
  }
  if (!any) throw reader.error("no valid bin: every value is negative", header_size);
  return result;
}

std::string Merl::serialise() const {
  std::string bytes(header_size + values.size() * sizeof(double), '\0');
  const std::array<std::int32_t, 3> dimensions{theta_h_bins, theta_d_bins, phi_d_bins};
  std::memcpy(bytes.data(), dimensions.data(), header_size);
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double stored = values[k] / scales[k / bins];
    std::memcpy(bytes.data() + header_size + k * sizeof(double), &stored, sizeof(double));
  }
  return bytes;
}

HalfDifference Merl::centre(std::size_t bin) {
  const auto middle = [](std::size_t index) { return static_cast<double>(index) + 0.5; };
  const double root = middle(bin / (phi_d_bins * theta_d_bins));
  return {radians(root * root / theta_h_bins), radians(middle(bin / phi_d_bins % theta_d_bins)),
          radians(middle(bin % phi_d_bins))};
}

std::size_t Merl::bin_of(const Direction& wi, const Direction& wo) {
  const HalfDifference angles = HalfDifference::of(wi, wo);
  const auto index = [](double fraction, std::size_t count) {
    return std::min(static_cast<std::size_t>(std::max(fraction, 0.0) * static_cast<double>(count)), count - 1);
  };
  const std::size_t h = index(std::sqrt(angles.theta_h / (0.5 * pi)), theta_h_bins),
                    d = index(angles.theta_d / (0.5 * pi), theta_d_bins), k = index(angles.phi_d / pi, phi_d_bins);
  return k + phi_d_bins * (d + theta_d_bins * h);
}

bool Merl::above(std::size_t bin) {
  const HalfDifference angles = centre(bin);
  return angles.wi().z > 0.0 && angles.wo().z > 0.0;
}

Table Merl::table() const {
  Table table;
  table.coordinates = Coordinates::rusinkiewicz;
  table.grid = {.theta_i = {"theta_d", "degree", {}, true},
                .theta_o = {"theta_h", "degree", {}, true},
                .phi = {"phi_d", "degree", {}, true}};
  for (std::size_t k = 0; k < theta_d_bins; ++k) {
    const double middle = static_cast<double>(k) + 0.5;
    table.grid.theta_i.values.push_back(middle);
    table.grid.theta_o.values.push_back(middle * middle / theta_h_bins);
  }
  for (std::size_t k = 0; k < phi_d_bins; ++k) table.grid.phi.values.push_back(static_cast<double>(k) + 0.5);
  table.channels = 3;
  table.allocate();
  for (std::size_t bin = 0; bin < bins; ++bin) {
    // Entries run as bins do.
    table.valid[bin] = above(bin) ? 1 : 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = values[c * bins + bin];
      if (value < 0.0) table.valid[bin] = 0;
      table.values[c * bins + bin] = value < 0.0 ? 0.0f : to_float(value);
    }
  }
  table.model = "measured";
  table.parameters = {{"format", "merl"}, {"isotropic", true}};
  table.method = "measured";
  table.mask_what_is_not_finite(0, table.entries());
  return table;
}

bool Merl::has_grid(const Table& table) {
  if (table.coordinates != Coordinates::rusinkiewicz || table.entries() != bins) return false;
  for (std::size_t bin : {std::size_t{0}, bins / 3, bins - 1}) {
    const HalfDifference angles = centre(bin);
    const auto same = [](double degree, double radian) { return std::abs(radians(degree) - radian) < 1e-9; };
    if (!same(table.grid.theta_o.values[table.theta_o_index(bin)], angles.theta_h) ||
        !same(table.grid.theta_i.values[table.theta_i_index(bin)], angles.theta_d) ||
        !same(table.grid.phi.values[table.phi_index(bin)], angles.phi_d)) {
      return false;
    }
  }
  return true;
}

Merl Merl::of_table(const Table& table) {
  Merl result;
  result.values.assign(3 * bins, -1.0);
  for (std::size_t bin = 0; bin < bins; ++bin) {
    if (!table.valid[bin]) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      result.values[c * bins + bin] = std::max(0.0f, table.value(bin, table.channels == 3 ? static_cast<int>(c) : 0));
    }
  }
  return result;
}

Merl Merl::of_brdf(const std::function<Rgb(const Direction& wi, const Direction& wo)>& brdf) {
  Merl result;
  result.values.assign(3 * bins, -1.0);
  constexpr std::size_t line = theta_d_bins * phi_d_bins;
  tbb::parallel_for(std::size_t{0}, theta_h_bins, [&](std::size_t h) {
    for (std::size_t bin = h * line; bin < (h + 1) * line; ++bin) {
      const HalfDifference angles = centre(bin);
      const Direction wi = angles.wi(), wo = angles.wo();
      if (!(wi.z > 0.0 && wo.z > 0.0)) continue;
      try {
        const Rgb f = (brdf(wi, wo) + brdf(wo, wi)) * 0.5;
        if (!std::isfinite(f.x + f.y + f.z)) continue;
        result.values[bin] = max(f.x, 0.0);
        result.values[bins + bin] = max(f.y, 0.0);
        result.values[2 * bins + bin] = max(f.z, 0.0);
      } catch (const Error&) {
        // The source has no value there.
      }
    }
  });
  return result;
}

}  // namespace lobefit
