#include "reference/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "models/error.h"
#include "models/parameter.h"
#include "reference/json_reader.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

Axis steps(const std::string& name, int count, double step) {
  Axis axis{name, "degree", {}, false};
  for (int i = 0; i < count; ++i) axis.values.push_back(i * step);
  return axis;
}

Grid regular(int theta_count, double theta_step, int phi_count, double phi_step) {
  return {steps("theta_i", theta_count, theta_step), steps("theta_o", theta_count, theta_step),
          steps("phi", phi_count, phi_step)};
}

}  // namespace

std::vector<double> Axis::weights() const {
  const std::size_t n = values.size();
  if (n == 1) return {1.0};
  std::vector<double> result(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    const double below = i > 0 ? values[i] - values[i - 1] : 0.0;
    const double above = i + 1 < n ? values[i + 1] - values[i] : 0.0;
    result[i] = 0.5 * (below + above);
  }
  if (midpoints) {
    // The outermost cells reach as far out as they reach in.
    result.front() *= 2.0;
    result.back() *= 2.0;
  }
  return result;
}

Grid Grid::measured() {
  const auto midpoints = [](const char* name, int count, double end) {
    Axis axis{name, "degree", {}, true};
    for (int k = 0; k < count; ++k) axis.values.push_back((k + 0.5) * end / count);
    return axis;
  };
  return {midpoints("theta_i", 45, 80.0), midpoints("theta_o", 45, 80.0), midpoints("phi", 90, 180.0)};
}

Grid Grid::named_or_file(const std::string& name, bool sphere) {
  if (name == "small") return regular(9, 10.0, 10, 20.0);
  if (name == "default") return regular(18, 5.0, 19, 10.0);
  if (name == "fine") return regular(36, 2.5, 37, 5.0);
  if (name == "measured") return measured();
  std::error_code ignored;
  if (!std::filesystem::exists(name, ignored)) {
    throw Error(ExitCode::usage, "unknown grid '" + name + "'", "--grid",
                "choose small, default, fine, measured, or a JSON file {\"theta_i\":[…],\"theta_o\":[…],\"phi\":[…]}");
  }
  return from_json(parse_json(read_file(name), name), name, sphere);
}

void check_angles(const JsonReader& reader, double upper, bool closed) {
  const std::vector<double> angles = reader.numbers();
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double angle = angles[i];
    if (!(angle >= 0.0 && (closed ? angle <= upper : angle < upper))) {
      throw reader.error(
          number_text(angle) + " is out of range",
          "choose angles from 0 to " + std::string(closed ? "" : "below ") + number_text(upper) + " degrees");
    }
    if (i > 0 && !(angle > angles[i - 1])) {
      throw reader.error("angles do not increase", "sort them and remove repetitions");
    }
  }
}

Grid Grid::from_json(const Json& json, const std::string& place, bool sphere) {
  return from_json(JsonReader(json, place), sphere);
}

Grid Grid::from_json(const JsonReader& reader, bool sphere) {
  reader.allow({"theta_i", "theta_o", "phi", "midpoints"});
  const bool midpoints = reader.has("midpoints") && reader.at("midpoints").boolean();
  const auto axis = [&](const char* name, double upper, bool closed) {
    Axis result{name, "degree", reader.at(name).numbers(), midpoints};
    check_angles(reader.at(name), upper, closed);
    return result;
  };
  const double horizon = sphere ? 180.0 : 90.0;
  return {axis("theta_i", horizon, sphere), axis("theta_o", horizon, sphere), axis("phi", 360.0, false)};
}

std::size_t Table::parameter_rows() const {
  std::size_t rows = 1;
  for (const Axis& axis : parameter_axes) rows *= axis.size();
  return rows;
}

std::size_t Table::masked() const { return static_cast<std::size_t>(std::count(valid.begin(), valid.end(), 0)); }

std::vector<std::size_t> Table::failed() const {
  std::vector<std::size_t> result;
  for (std::size_t entry = 0; entry < entries(); ++entry) {
    if (!valid[entry] && shards.hold(entry / width())) result.push_back(entry);
  }
  return result;
}

void Table::allocate() {
  const std::size_t count = static_cast<std::size_t>(channels) * entries();
  values.assign(count, 0.0f);
  stderr_values.assign(count, 0.0f);
  valid.assign(entries(), 1);
  if (coordinates == Coordinates::list) {
    directions.assign(6 * entries(), 0.0f);
    measure.assign(entries(), 0.0f);
  }
  order_values.assign(static_cast<std::size_t>(orders) * entries(), 0.0f);
  order_stderr.assign(order_values.size(), 0.0f);
}

std::vector<Plane> Table::planes() {
  constexpr std::array<const char*, 3> rgb_names{"R", "G", "B"};
  std::vector<Plane> result;
  for (int c = 0; c < channels; ++c) {
    const std::size_t offset = static_cast<std::size_t>(c) * entries();
    const std::string name = channels == 1 ? "Y" : rgb_names[static_cast<std::size_t>(c)];
    result.push_back({name, values.data() + offset});
    result.push_back({"stderr." + name, stderr_values.data() + offset});
    for (std::size_t r = 0; r * values.size() < replicates.size(); ++r) {
      result.push_back({"replicate." + std::to_string(r) + "." + name, replicates.data() + r * values.size() + offset});
    }
  }
  for (std::size_t n = 0; n < static_cast<std::size_t>(orders); ++n) {
    const std::string name = "order." + std::to_string(n + 1) + ".Y";
    const std::size_t offset = n * entries();
    result.push_back({name, order_values.data() + offset});
    result.push_back({"stderr." + name, order_stderr.data() + offset});
    for (std::size_t r = 0; r * order_values.size() < order_replicates.size(); ++r) {
      result.push_back(
          {"replicate." + std::to_string(r) + "." + name, order_replicates.data() + r * order_values.size() + offset});
    }
  }
  if (!sample_counts.empty()) result.push_back({"samples", sample_counts.data()});
  if (coordinates == Coordinates::list) {
    constexpr std::array<const char*, 6> names{"wi.x", "wi.y", "wi.z", "wo.x", "wo.y", "wo.z"};
    for (std::size_t k = 0; k < names.size(); ++k) result.push_back({names[k], directions.data() + k * entries()});
    result.push_back({"measure", measure.data()});
  }
  return result;
}

void Table::mask_what_is_not_finite(std::size_t first, std::size_t n) {
  for (const Plane& plane : planes()) {
    for (std::size_t entry = first; entry < first + n; ++entry) {
      if (!std::isfinite(plane.data[entry])) valid[entry] = 0;
    }
  }
}

HalfDifference HalfDifference::of(const Direction& wi, const Direction& wo) {
  const Direction h = normalize(wi + wo);
  const double sin_h = std::hypot(h.x, h.y);
  // Azimuth of h; any where it is the normal.
  const double cos_phi = sin_h > 0.0 ? h.x / sin_h : 1.0, sin_phi = sin_h > 0.0 ? h.y / sin_h : 0.0;
  // The light seen from the half vector: turned by -phi_h about the normal, then by -theta_h about y.
  const double x = cos_phi * wi.x + sin_phi * wi.y, y = cos_phi * wi.y - sin_phi * wi.x;
  const double dx = h.z * x - sin_h * wi.z, dz = sin_h * x + h.z * wi.z;
  double phi_d = std::atan2(y, dx);
  if (phi_d < 0.0) phi_d += pi;
  if (phi_d >= pi) phi_d -= pi;
  return {std::atan2(sin_h, h.z), std::atan2(std::hypot(dx, y), dz), phi_d};
}

Direction HalfDifference::wi() const {
  const Direction d = direction(theta_d, phi_d);
  return {std::cos(theta_h) * d.x + std::sin(theta_h) * d.z, d.y, std::cos(theta_h) * d.z - std::sin(theta_h) * d.x};
}

Direction HalfDifference::wo() const {
  // The light mirrored at the half vector is d turned by half a circle about it.
  return HalfDifference{theta_h, theta_d, phi_d + pi}.wi();
}

namespace {

HalfDifference half_difference(const Table& table, std::size_t entry) {
  return {radians(table.grid.theta_o.values[table.theta_o_index(entry)]),
          radians(table.grid.theta_i.values[table.theta_i_index(entry)]),
          radians(table.grid.phi.values[table.phi_index(entry)])};
}

Direction from_planes(const std::vector<float>& planes, std::size_t entries, std::size_t first, std::size_t entry) {
  return normalize(Direction{planes[first * entries + entry], planes[(first + 1) * entries + entry],
                             planes[(first + 2) * entries + entry]});
}

}  // namespace

Direction Table::wi(std::size_t entry) const {
  if (coordinates == Coordinates::rusinkiewicz) return half_difference(*this, entry).wi();
  if (coordinates == Coordinates::list) return from_planes(directions, entries(), 0, entry);
  return direction(radians(grid.theta_i.values[theta_i_index(entry)]), radians(grid.phi.values[phi_index(entry)]));
}

Direction Table::wo(std::size_t entry) const {
  if (coordinates == Coordinates::rusinkiewicz) return half_difference(*this, entry).wo();
  if (coordinates == Coordinates::list) return from_planes(directions, entries(), 3, entry);
  return direction(radians(grid.theta_o.values[theta_o_index(entry)]), 0.0);
}

void Table::set_directions(std::size_t entry, const Direction& wi, const Direction& wo) {
  const std::array<double, 6> all{wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
  for (std::size_t k = 0; k < all.size(); ++k) directions[k * entries() + entry] = static_cast<float>(all[k]);
}

std::vector<double> Table::quadrature_weights() const {
  const std::vector<double> weights_i = grid.theta_i.weights(), weights_o = grid.theta_o.weights(),
                            weights_phi = grid.phi.weights();
  std::vector<double> weights(entries());
  for (std::size_t entry = 0; entry < weights.size(); ++entry) {
    const double cell =
        weights_i[theta_i_index(entry)] * weights_o[theta_o_index(entry)] * weights_phi[phi_index(entry)];
    if (coordinates == Coordinates::spherical) {
      weights[entry] = cell;
      continue;
    }
    const double sines = measured_sine(wi(entry)) * measured_sine(wo(entry));
    if (coordinates == Coordinates::list) {
      weights[entry] = measure[entry] / sines;
      continue;
    }
    // d omega_i d omega_o = 4 cos(theta_d) d omega_h d omega_d.
    const HalfDifference angles = half_difference(*this, entry);
    weights[entry] =
        cell * 4.0 * std::cos(angles.theta_d) * std::sin(angles.theta_d) * std::sin(angles.theta_h) / sines;
  }
  return weights;
}

bool Table::reaches_below() const {
  return coordinates == Coordinates::spherical &&
         (grid.theta_i.values.back() >= 90.0 || grid.theta_o.values.back() >= 90.0);
}

bool Table::same_grid(const Table& other) const {
  return coordinates == other.coordinates && describe()["axes"] == other.describe()["axes"] &&
         directions == other.directions;
}

std::string Table::place(std::size_t entry) const {
  if (coordinates != Coordinates::spherical) {
    const auto angles = [](const Direction& w) {
      return number_text(degrees(std::acos(std::clamp(w.z, -1.0, 1.0)))) + "," +
             number_text(degrees(std::atan2(w.y, w.x)));
    };
    return "entry " + std::to_string(entry) + ", wi " + angles(wi(entry)) + ", wo " + angles(wo(entry));
  }
  std::string text = "theta_i " + number_text(grid.theta_i.values[theta_i_index(entry)]) + ", theta_o " +
                     number_text(grid.theta_o.values[theta_o_index(entry)]) + ", phi " +
                     number_text(grid.phi.values[phi_index(entry)]);
  const std::vector<double> row_values = parameter_values(parameter_row(entry));
  for (std::size_t i = 0; i < row_values.size(); ++i) {
    text += ", " + parameter_axes[i].name + " " + number_text(row_values[i]);
  }
  return text;
}

std::vector<double> Table::parameter_values(std::size_t row) const {
  std::vector<double> result(parameter_axes.size());
  for (std::size_t i = parameter_axes.size(); i-- > 0;) {
    result[i] = parameter_axes[i].values[row % parameter_axes[i].size()];
    row /= parameter_axes[i].size();
  }
  return result;
}

Table Table::with_values(const std::string& name, std::vector<float> other) const {
  Table result;
  result.coordinates = coordinates;
  result.directions = directions;
  result.measure = measure;
  result.grid = grid;
  result.parameter_axes = parameter_axes;
  result.channels = channels;
  result.model = name;
  result.parameters = Json::object();
  result.method = "exact";
  result.version = version;
  result.values = std::move(other);
  result.stderr_values.assign(result.values.size(), 0.0f);
  result.valid = valid;
  return result;
}

Rgb Table::interpolate_half_difference(std::size_t row, const Direction& light, const Direction& view) const {
  if (!(light.z > 0.0 && view.z > 0.0)) {
    throw Error(ExitCode::usage, "a direction lies under the surface", "", "choose angles below 90 degrees");
  }
  const HalfDifference angles = HalfDifference::of(light, view);
  struct Place {
    std::size_t below, above;
    double fraction;
  };
  // Outside the outermost values, theirs; an angle with a period goes from the last on to the first.
  const auto locate = [](const Axis& axis, double angle, double period) -> Place {
    const std::size_t last = axis.size() - 1;
    const auto next =
        static_cast<std::size_t>(std::upper_bound(axis.values.begin(), axis.values.end(), angle) - axis.values.begin());
    if (next > 0 && next <= last) {
      return {next - 1, next, (angle - axis.values[next - 1]) / (axis.values[next] - axis.values[next - 1])};
    }
    if (period == 0.0) return next == 0 ? Place{0, 0, 0.0} : Place{last, last, 0.0};
    const double gap = axis.values.front() + period - axis.values.back();
    return {last, 0, (next == 0 ? angle + period - axis.values.back() : angle - axis.values.back()) / gap};
  };
  const Place h = locate(grid.theta_o, degrees(angles.theta_h), 0.0),
              d = locate(grid.theta_i, degrees(angles.theta_d), 0.0),
              k = locate(grid.phi, degrees(angles.phi_d), 180.0);
  std::array<double, 3> sum{};
  double total = 0.0;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const auto step = [&](const Place& place, std::size_t bit) {
      return (corner >> bit & 1) != 0 ? place.fraction : 1.0 - place.fraction;
    };
    const auto index = [&](const Place& place, std::size_t bit) {
      return (corner >> bit & 1) != 0 ? place.above : place.below;
    };
    const std::size_t entry =
        (row * lines_per_parameter() + index(h, 0)) * width() + index(d, 1) * grid.phi.size() + index(k, 2);
    const double weight = step(h, 0) * step(d, 1) * step(k, 2);
    constexpr double least = 1e-9;  // angles that went through a direction: a bin's own centre is not its neighbour's
    if (weight < least || !valid[entry]) continue;
    total += weight;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * value(entry, channels == 3 ? static_cast<int>(c) : 0);
  }
  if (total == 0.0) throw Error(ExitCode::usage, "the table is masked there", "", "choose other angles");
  return {sum[0] / total, sum[1] / total, sum[2] / total};
}

Rgb Table::nearest_of_list(std::size_t row, const Direction& light, const Direction& view) const {
  const auto isotropic = parameters.find("isotropic");
  const bool turns = isotropic != parameters.end() && *isotropic == true;
  const std::size_t count = width() * lines_per_parameter();
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  const double light_sine = std::hypot(light.x, light.y);
  for (std::size_t entry = row * count; entry < (row + 1) * count; ++entry) {
    if (!valid[entry]) continue;
    const Direction there_i = wi(entry), there_o = wo(entry);
    Direction here_i = light, here_o = view;
    const double there_sine = std::hypot(there_i.x, there_i.y);
    if (turns && light_sine > 0.0 && there_sine > 0.0) {
      // The pair turned about the normal so that both lights have one azimuth.
      const double c = (light.x * there_i.x + light.y * there_i.y) / (light_sine * there_sine);
      const double s = (light.x * there_i.y - light.y * there_i.x) / (light_sine * there_sine);
      here_i = {c * light.x - s * light.y, s * light.x + c * light.y, light.z};
      here_o = {c * view.x - s * view.y, s * view.x + c * view.y, view.z};
    }
    const Direction apart_i = here_i - there_i, apart_o = here_o - there_o;
    const double distance = dot(apart_i, apart_i) + dot(apart_o, apart_o);
    if (distance < least) {
      least = distance;
      best = entry;
    }
  }
  constexpr double farthest = 0.1;  // radians, about 6 degrees: beyond it the file says nothing
  if (!(least < farthest * farthest)) {
    throw Error(ExitCode::usage, "the table has no entry near these directions", "",
                "`lobefit table slice` lists its entries");
  }
  return {value(best, 0), value(best, channels == 3 ? 1 : 0), value(best, channels == 3 ? 2 : 0)};
}

Rgb Table::interpolate(std::size_t row, const Direction& light, const Direction& view) const {
  if (coordinates == Coordinates::rusinkiewicz) return interpolate_half_difference(row, light, view);
  if (coordinates == Coordinates::list) return nearest_of_list(row, light, view);
  struct Place {
    std::size_t index;
    double fraction;
  };
  const auto locate = [](const Axis& axis, double angle) -> Place {
    constexpr double tolerance = 1e-6;  // degrees: the angle went through a cosine
    if (angle < axis.values.front() - tolerance || angle > axis.values.back() + tolerance) {
      throw Error(
          ExitCode::usage, axis.name + " = " + number_text(angle) + " lies outside the table", "",
          "choose an angle from " + number_text(axis.values.front()) + " to " + number_text(axis.values.back()));
    }
    if (axis.size() == 1) return {0, 0.0};
    const auto above = std::upper_bound(axis.values.begin(), axis.values.end() - 1, angle);
    const std::size_t index = std::max<std::size_t>(1, static_cast<std::size_t>(above - axis.values.begin())) - 1;
    const double fraction = (angle - axis.values[index]) / (axis.values[index + 1] - axis.values[index]);
    return {index, std::clamp(fraction, 0.0, 1.0)};
  };
  const auto polar = [](const Direction& w) { return degrees(std::atan2(std::hypot(w.x, w.y), w.z)); };
  const double azimuth =
      degrees(std::abs(std::atan2(light.x * view.y - light.y * view.x, light.x * view.x + light.y * view.y)));
  const Place i = locate(grid.theta_i, polar(light)), o = locate(grid.theta_o, polar(view)),
              k = locate(grid.phi, azimuth);
  std::array<double, 3> sum{};
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const auto step = [&](const Place& place, std::size_t bit) {
      return (corner >> bit & 1) != 0 ? place.fraction : 1.0 - place.fraction;
    };
    const double weight = step(i, 0) * step(o, 1) * step(k, 2);
    if (weight == 0.0) continue;
    const std::size_t entry = (row * lines_per_parameter() + o.index + (corner >> 1 & 1)) * width() +
                              (i.index + (corner & 1)) * grid.phi.size() + k.index + (corner >> 2 & 1);
    if (!valid[entry]) throw Error(ExitCode::usage, "the table is masked there", "", "choose other angles");
    for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * value(entry, channels == 3 ? static_cast<int>(c) : 0);
  }
  return {sum[0], sum[1], sum[2]};
}

Table Table::with_albedo(const Rgb& albedo) const {
  if (orders == 0) {
    throw Error(ExitCode::usage, "the table keeps no orders of scattering", "",
                "render it with --orders: then any albedo follows from it");
  }
  const auto own = parameters.find("albedo");
  if (own == parameters.end() || !(own->is_array() || own->is_number())) {
    // An axis, or a reference whose orders are no powers of an albedo.
    throw Error(ExitCode::usage, "the table has no single albedo that could be another", model,
                "give a table that was rendered with --orders at one albedo");
  }
  Table result = *this;
  result.channels = albedo.x == albedo.y && albedo.x == albedo.z ? 1 : 3;
  result.parameters["albedo"] = {albedo.x, albedo.y, albedo.z};
  const std::size_t count = entries(), order_count = static_cast<std::size_t>(orders);
  result.values.assign(static_cast<std::size_t>(result.channels) * count, 0.0f);
  result.stderr_values.assign(result.values.size(), 0.0f);
  if (!order_replicates.empty()) result.replicates.assign(result.values.size() * replicate_count, 0.0f);
  const auto sum_orders = [&](const float* planes, std::size_t entry, double rho) {
    double sum = 0.0;
    for (std::size_t n = order_count; n-- > 0;) sum = rho * (sum + planes[n * count + entry]);
    return sum;
  };
  for (std::size_t c = 0; c < static_cast<std::size_t>(result.channels); ++c) {
    const double rho = c == 0 ? albedo.x : c == 1 ? albedo.y : albedo.z;
    for (std::size_t entry = 0; entry < count; ++entry) {
      const std::size_t slot = c * count + entry;
      result.values[slot] = static_cast<float>(sum_orders(order_values.data(), entry, rho));
      if (order_replicates.empty()) {
        // Orders share their paths: their errors may all have one sign, so they add up at worst.
        result.stderr_values[slot] = static_cast<float>(sum_orders(order_stderr.data(), entry, rho));
        continue;
      }
      std::array<double, replicate_count> column;
      for (std::size_t r = 0; r < replicate_count; ++r) {
        column[r] = sum_orders(order_replicates.data() + r * order_count * count, entry, rho);
        result.replicates[r * result.values.size() + slot] = static_cast<float>(column[r]);
      }
      result.stderr_values[slot] = static_cast<float>(mean_and_error(std::span<const double>(column)).standard_error);
    }
  }
  return result;
}

Table Table::row_slice(std::size_t row) const {
  Table slice = *this;
  const std::vector<double> row_values = parameter_values(row);
  for (std::size_t i = 0; i < parameter_axes.size(); ++i) slice.parameters[parameter_axes[i].name] = row_values[i];
  slice.parameter_axes.clear();
  slice.shards = {};  // shards count lines of the whole table
  const std::size_t count = slice.entries(), first = row * count;
  const auto cut = [&](const auto& all, auto& part) {
    part.clear();
    for (std::size_t plane = 0; plane * entries() < all.size(); ++plane) {
      const auto begin = all.begin() + static_cast<std::ptrdiff_t>(plane * entries() + first);
      part.insert(part.end(), begin, begin + static_cast<std::ptrdiff_t>(count));
    }
  };
  cut(values, slice.values);
  cut(stderr_values, slice.stderr_values);
  cut(replicates, slice.replicates);
  cut(sample_counts, slice.sample_counts);
  cut(order_values, slice.order_values);
  cut(order_stderr, slice.order_stderr);
  cut(order_replicates, slice.order_replicates);
  cut(valid, slice.valid);
  cut(directions, slice.directions);
  cut(measure, slice.measure);
  return slice;
}

Json Table::describe() const {
  Json axes = Json::array();
  const auto add = [&](const Axis& axis) {
    axes.push_back({{"name", axis.name},
                    {"unit", axis.unit},
                    {"kind", axis.midpoints ? "midpoints" : "points"},
                    {"values", axis.values},
                    {"weights", axis.weights()}});
  };
  for (const Axis& axis : parameter_axes) add(axis);
  add(grid.theta_o);
  add(grid.theta_i);
  add(grid.phi);
  Json provenance{
      {"reference", model}, {"params", parameters}, {"method", method}, {"seed", seed}, {"samples", samples}};
  if (!sampler.empty()) provenance["sampler"] = sampler;
  if (stderr_target > 0.0) provenance["stderr_target"] = stderr_target;
  provenance["shared_facets"] = shared_facets;
  if (shards.count > 1) provenance["shard"] = shards.text();
  provenance["version"] = version;
  provenance["command"] = command;
  return {{"axes", axes},
          {"coordinates", coordinates_names[static_cast<std::size_t>(coordinates)]},
          {"quantity", "brdf 1/sr"},
          {"channels", channels == 1 ? Json{"Y"} : Json{"R", "G", "B"}},
          {"entries", entries()},
          {"masked", masked()},
          {"replicates", replicates.empty() ? 0 : replicate_count},
          {"orders", orders},
          {"provenance", provenance}};
}

Json Table::fingerprint() const {
  const Json description = describe();
  Json result = description["provenance"];
  result.erase("command");
  result.erase("shard");
  result["channels"] = description["channels"];
  result["orders"] = orders;
  result["axes"] = Json::object();
  for (const Json& axis : description["axes"]) {
    result["axes"][axis["name"].get<std::string>()] = {{"kind", axis["kind"]}, {"values", axis["values"]}};
  }
  return result;
}

std::string differences(const Json& there, const Json& here) {
  std::string result;
  const auto told = [](const Json& value) {
    const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
    constexpr std::size_t longest = 60;
    return text.size() <= longest ? text : "";
  };
  const auto compare = [&](const auto& self, const Json& a, const Json& b, const std::string& name) -> void {
    if (a == b) return;
    if (a.is_object() && b.is_object()) {
      const std::string prefix = name.empty() ? "" : name + ".";
      for (const auto& [key, value] : a.items()) self(self, value, b.contains(key) ? b[key] : Json(), prefix + key);
      for (const auto& [key, value] : b.items()) {
        if (!a.contains(key)) self(self, Json(), value, prefix + key);
      }
      return;
    }
    if (!result.empty()) result += ", ";
    const std::string then = told(a), now = told(b);
    result += then.empty() || now.empty() ? name + " differs" : name + " is " + then + " there and " + now + " here";
  };
  compare(compare, there, here, "");
  return result.empty() && there != here ? "axes are in another order" : result;
}

}  // namespace lobefit
