// The meeting point: BRDF values over a grid of directions, whatever they came from.
//
// A table is a picture. Column x = i_phi + Nphi i_theta_i, line y = i_theta_o + Ntheta_o i_parameter, the parameter
// axes flattened with the last running fastest. Values are BRDFs in 1/sr without cosine, 32-bit float, each with a
// standard error (0 where exact) and a mask. Tables whose entries have correlated errors keep their replicates.
//
// Measured files keep their own grids: the three axes are then others (`rusinkiewicz`: theta_h, theta_d, phi_d in the
// places of theta_o, theta_i, phi) or mere counters of a `list` that holds the directions of each entry.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "models/geometry.h"
#include "reference/estimate.h"
#include "reference/shards.h"

namespace lobefit {

using Json = nlohmann::ordered_json;
class JsonReader;

struct Axis {
  std::string name;
  std::string unit;
  std::vector<double> values;
  bool midpoints = false;  // values are the middles of cells, else points

  std::size_t size() const { return values.size(); }
  /// Quadrature weights along the axis: cell widths for midpoints, trapezoids for points; {1} for a single value.
  std::vector<double> weights() const;
};

/// Polar angles and azimuth differences in degrees; theta in [0, 90), for what has a BRDF over the whole `sphere` in
/// [0, 180]; phi in [0, 360).
struct Grid {
  Axis theta_i, theta_o, phi;

  /// Where isotropic measurements are fitted and scored: midpoints of 45 steps over 0…80° in both polar angles and of
  /// 90 over 0…180° in azimuth.
  static Grid measured();
  /// "small" (9 × 9 × 10), "default" (18 × 18 × 19), "fine" (36 × 36 × 37), "measured", or a JSON file of angles.
  static Grid named_or_file(const std::string& name, bool sphere = false);
  /// From {"theta_i": […], "theta_o": […], "phi": […], "midpoints": false}; `place` names the file in errors.
  static Grid from_json(const Json& json, const std::string& place, bool sphere = false);
  static Grid from_json(const JsonReader& reader, bool sphere = false);
};

/// How a table's three axes give directions.
enum class Coordinates { spherical, rusinkiewicz, list };
inline constexpr std::array<std::string_view, 3> coordinates_names{"spherical", "rusinkiewicz", "list"};

/// Angles of half and difference vector (Rusinkiewicz 1998) in radians, of a pair that may turn about the normal and
/// whose directions may change places: phi_d in [0, pi).
struct HalfDifference {
  double theta_h, theta_d, phi_d;

  static HalfDifference of(const Direction& wi, const Direction& wo);
  /// The pair with the half vector at azimuth 0; either may lie under the surface.
  Direction wi() const;
  Direction wo() const;
};

/// Sines by which a list's measure is made and divided, kept off 0.
inline double measured_sine(const Direction& w) { return std::max(std::hypot(w.x, w.y), 1e-3); }

/// One named plane of a table's picture.
struct Plane {
  std::string name;
  float* data;  // [entry]
};

struct Table {
  Coordinates coordinates = Coordinates::spherical;
  Grid grid;
  std::vector<Axis> parameter_axes;
  int channels = 1;    // 1 (Y) or 3 (R, G, B)
  std::string model;   // what was rendered: a reference's or a model's name
  Json parameters;     // its parameters that are not axes
  std::string method;  // "monte_carlo" or "exact"
  std::uint64_t seed = 0, samples = 0;
  std::string sampler;         // "sobol" or "philox"; "" where exact
  double stderr_target = 0.0;  // > 0: `samples` were doubled until no standard error exceeded it
  bool shared_facets = false;  // a line's entries share their facets, so their errors are correlated
  Shards shards;               // which lines are rendered; the others are masked
  std::string version, command;

  std::vector<float> values;  // [channel][entry]
  std::vector<float> stderr_values;
  std::vector<float> replicates;     // [replicate][channel][entry], or empty
  std::vector<float> sample_counts;  // [entry] where sampling was adaptive, or empty
  // What order n = 1, 2, … of scattering adds, per unit of albedo to its nth power; the last one holds all further
  // ones.
  int orders = 0;
  std::vector<float> order_values;      // [order][entry]
  std::vector<float> order_stderr;      // [order][entry]
  std::vector<float> order_replicates;  // [replicate][order][entry] where replicates are kept
  std::vector<std::uint8_t> valid;      // [entry]
  // Of a list alone. Directions are kept as files hold them and normalised on the way out.
  std::vector<float> directions;  // [wi.x wi.y wi.z wo.x wo.y wo.z][entry]
  std::vector<float> measure;     // [entry]: d omega_i d omega_o of quadrature, with measured_sine() for the sines

  std::size_t width() const { return grid.phi.size() * grid.theta_i.size(); }
  std::size_t lines_per_parameter() const { return grid.theta_o.size(); }
  std::size_t parameter_rows() const;
  std::size_t height() const { return lines_per_parameter() * parameter_rows(); }
  std::size_t entries() const { return width() * height(); }
  std::size_t masked() const;
  /// Masked entries of the lines that were rendered: their results were no finite numbers.
  std::vector<std::size_t> failed() const;

  /// Sizes the arrays to the axes, all entries valid and zero.
  void allocate();
  /// Every plane of an allocated table, in file terms. The mask is apart.
  std::vector<Plane> planes();
  /// Masks those of the entries first, …, first + n - 1 of which any number is not finite.
  void mask_what_is_not_finite(std::size_t first, std::size_t n);
  float value(std::size_t entry, int channel = 0) const {
    return values[static_cast<std::size_t>(channel) * entries() + entry];
  }
  float standard_error(std::size_t entry, int channel = 0) const {
    return stderr_values[static_cast<std::size_t>(channel) * entries() + entry];
  }
  float replicate(int index, std::size_t entry, int channel = 0) const {
    return replicates[(static_cast<std::size_t>(index) * static_cast<std::size_t>(channels) +
                       static_cast<std::size_t>(channel)) *
                          entries() +
                      entry];
  }

  /// The same surface at another albedo, from its orders; errors included. Throws Error(usage) without orders.
  Table with_albedo(const Rgb& albedo) const;

  std::size_t parameter_row(std::size_t entry) const { return entry / (width() * lines_per_parameter()); }
  std::size_t theta_o_index(std::size_t entry) const { return entry / width() % lines_per_parameter(); }
  std::size_t theta_i_index(std::size_t entry) const { return entry % width() / grid.phi.size(); }
  std::size_t phi_index(std::size_t entry) const { return entry % grid.phi.size(); }
  /// Spherical: the view lies in the plane of azimuth 0, the light at azimuth phi. Bins of measured grids may have
  /// directions under the surface; they are masked.
  Direction wi(std::size_t entry) const;
  Direction wo(std::size_t entry) const;
  void set_directions(std::size_t entry, const Direction& wi, const Direction& wo);
  /// Quadrature weights of all entries but for sin(theta_i) sin(theta_o): products of the axes' weights in degrees
  /// where the coordinates are spherical.
  std::vector<double> quadrature_weights() const;
  /// Where an entry lies: `theta_i 30, theta_o 0, phi 180, alpha 0.5`.
  std::string place(std::size_t entry) const;
  /// Values of the parameter axes in one row.
  std::vector<double> parameter_values(std::size_t row) const;

  /// The same grid with other values and no errors, rendered from `name`.
  Table with_values(const std::string& name, std::vector<float> other) const;
  /// Value at any pair of directions: linear in the angles between grid points, among the neighbours that are not
  /// masked on a Rusinkiewicz grid; the nearest entry of a list. Throws Error(usage) outside the grid's angles, and
  /// where neighbours are masked.
  Rgb interpolate(std::size_t row, const Direction& light, const Direction& view) const;
  /// Whether the angles reach the horizon or pass it: light that passes, or a fibre.
  bool reaches_below() const;
  /// Whether both tables have the same entries at the same places.
  bool same_grid(const Table& other) const;
  /// The table of one parameter row alone, without parameter axes.
  Table row_slice(std::size_t row) const;

  /// Writes an EXR; throws Error(failure). `path` is used as it is: see OutputFile.
  void write(const std::filesystem::path& path) const;
  /// Reads what write() wrote; throws Error(invalid_input) naming the file and what is wrong in it.
  static Table read(const std::filesystem::path& path);
  Json describe() const;

 private:
  Rgb interpolate_half_difference(std::size_t row, const Direction& light, const Direction& view) const;
  Rgb nearest_of_list(std::size_t row, const Direction& light, const Direction& view) const;

 public:
  /// What determines every bit of the values: tables that agree in it are parts of one render. Neither the command as
  /// it was given nor the shards.
  Json fingerprint() const;
};

/// In which entries two fingerprints differ: `seed is 1 there and 2 here, …`
std::string differences(const Json& there, const Json& here);

}  // namespace lobefit
