// A rough surface that exists: a periodic Gaussian height field, triangulated.
//
// Heights are Gaussian with autocorrelation exp(-r²/ℓ²), so slopes are Gaussian too: a Beckmann surface. Horizontal
// coordinates are in cells; the patch spans [-cells/2, cells/2)² and repeats beyond. Every cell is split into two flat
// facets along diagonals that alternate like a checkerboard: the slopes of a facet along x and y are height differences
// along its two legs, exactly Gaussian, and what little these legs correlate cancels between neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "models/scalar.h"
#include "reference/sample_points.h"

namespace lobefit {

struct Slope {
  double x, y;
};

/// Moments of facet slopes over the area of the patch. A Gaussian has kurtosis 3.
struct SlopeStatistics {
  double rms_x, rms_y, kurtosis_x, kurtosis_y, correlation;
};

class HeightField {
 public:
  /// Row by row; `cells` is even, at least 2.
  HeightField(int cells, std::vector<float> heights);

  /// White noise convolved with a Gaussian: exact, and periodic by construction. Scaled so that the facets' mean square
  /// slope is alpha²/2 per axis, Beckmann's. `correlation_length` ℓ is in cells, at most cells/4.
  static HeightField gaussian(int cells, double correlation_length, double alpha, const StreamKey& key);

  int cells() const { return cells_; }
  std::uint32_t facets() const { return 2u * static_cast<std::uint32_t>(cells_) * static_cast<std::uint32_t>(cells_); }
  /// Height at a grid point; indices wrap around.
  float height(int column, int row) const { return heights_[index(column, row)]; }
  float lowest() const { return lowest_; }
  float highest() const { return highest_; }

  /// Facet `half` (0: lower, 1: upper) of a cell as offsets of its corners, counter-clockwise from above.
  static std::array<std::array<int, 2>, 3> corners(int column, int row, int half);
  /// Number of a facet; indices wrap around.
  std::uint32_t facet(int column, int row, int half) const {
    return 2u * static_cast<std::uint32_t>(index(column, row)) + static_cast<std::uint32_t>(half);
  }
  Slope slope(std::uint32_t facet) const;
  Direction normal(std::uint32_t facet) const;
  SlopeStatistics slope_statistics() const;
  /// Area of the facets that face a direction, seen from there, per unit of macroscopic area: ∫ (w·m)⁺ D dm. Smith's
  /// theory puts it at cosθ (1 + Λ).
  double facing_area(const Direction& w) const;

 private:
  int wrapped(int i) const { return (i % cells_ + cells_) % cells_; }
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(wrapped(row)) * static_cast<std::size_t>(cells_) +
           static_cast<std::size_t>(wrapped(column));
  }

  int cells_;
  std::vector<float> heights_;
  float lowest_, highest_;
};

}  // namespace lobefit
