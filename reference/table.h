// The meeting point: BRDF values over a grid of directions, whatever they came from.
//
// A table is a picture. Column x = i_phi + Nphi i_theta_i, line y = i_theta_o + Ntheta_o i_parameter, the parameter
// axes flattened with the last running fastest. Values are BRDFs in 1/sr without cosine, 32-bit float, each with a
// standard error (0 where exact) and a mask. Tables whose entries have correlated errors keep their replicates.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
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

  /// "small" (9 × 9 × 10), "default" (18 × 18 × 19), "fine" (36 × 36 × 37), or a JSON file of angles.
  static Grid named_or_file(const std::string& name, bool sphere = false);
  /// From {"theta_i": […], "theta_o": […], "phi": […], "midpoints": false}; `place` names the file in errors.
  static Grid from_json(const Json& json, const std::string& place, bool sphere = false);
  static Grid from_json(const JsonReader& reader, bool sphere = false);
};

/// One named plane of a table's picture.
struct Plane {
  std::string name;
  float* data;  // [entry]
};

struct Table {
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
  /// The view lies in the plane of azimuth 0, the light at azimuth phi.
  Direction wi(std::size_t entry) const;
  Direction wo(std::size_t entry) const;
  /// Where an entry lies: `theta_i 30, theta_o 0, phi 180, alpha 0.5`.
  std::string place(std::size_t entry) const;
  /// Values of the parameter axes in one row.
  std::vector<double> parameter_values(std::size_t row) const;

  /// The same grid with other values and no errors, rendered from `name`.
  Table with_values(const std::string& name, std::vector<float> other) const;
  /// Value and error at any pair of directions: linear in the angles between grid points. Throws Error(usage) outside
  /// the grid's angles, and where the row's neighbours are masked.
  Rgb interpolate(std::size_t row, const Direction& light, const Direction& view) const;
  /// The table of one parameter row alone, without parameter axes.
  Table row_slice(std::size_t row) const;

  /// Writes an EXR; throws Error(failure). `path` is used as it is: see OutputFile.
  void write(const std::filesystem::path& path) const;
  /// Reads what write() wrote; throws Error(invalid_input) naming the file and what is wrong in it.
  static Table read(const std::filesystem::path& path);
  Json describe() const;
  /// What determines every bit of the values: tables that agree in it are parts of one render. Neither the command as
  /// it was given nor the shards.
  Json fingerprint() const;
};

/// In which entries two fingerprints differ: `seed is 1 there and 2 here, …`
std::string differences(const Json& there, const Json& here);

}  // namespace lobefit
