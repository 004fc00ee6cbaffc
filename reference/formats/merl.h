// MERL tables (Matusik et al. 2003), `.binary`: isotropic BRDFs over half and difference angles.
//
// Three 32-bit integers 90, 90, 180, then planes of red, green and blue, 64-bit floats, phi_d running fastest, theta_h
// slowest. Bin k of theta_h reaches from k²/90 to (k+1)²/90 degrees, those of theta_d and phi_d over one degree. Stored
// numbers times 1/1500, 1.15/1500, 1.66/1500 are BRDFs in 1/sr; negative ones are invalid. Light and view may change
// places: phi_d covers half the circle.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "reference/table.h"

namespace lobefit {

struct Merl {
  static constexpr std::size_t theta_h_bins = 90, theta_d_bins = 90, phi_d_bins = 180;
  static constexpr std::size_t bins = theta_h_bins * theta_d_bins * phi_d_bins;

  std::vector<double> values;  // [channel][bin] in 1/sr; negative: invalid

  /// Throws Error(invalid_input) for another size, other dimensions, a value that is no number, or no valid bin.
  static Merl parse(std::string_view bytes, const std::string& place);
  /// The stored numbers come back within one unit in the last place.
  std::string serialise() const;

  static HalfDifference centre(std::size_t bin);
  /// The bin of a pair of directions above the surface.
  static std::size_t bin_of(const Direction& wi, const Direction& wo);
  /// Whether light and view at the bin's centre lie above the surface.
  static bool above(std::size_t bin);

  /// On Rusinkiewicz coordinates with the invalid bins masked.
  Table table() const;
  /// From a table on this very grid, else from values at the bins' centres: the mean of both orders of the directions,
  /// of which a bin stands for both; negative values become 0. Where `brdf` throws Error, the bin is invalid.
  static Merl of_table(const Table& table);
  static Merl of_brdf(const std::function<Rgb(const Direction& wi, const Direction& wo)>& brdf);
  static bool has_grid(const Table& table);
};

}  // namespace lobefit
