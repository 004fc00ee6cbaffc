#include "reference/height_field/height_field.h"

#include <algorithm>
#include <cmath>

#include "models/error.h"

namespace lobefit {

namespace {

/// Independent normal deviates (Box, Muller 1958), one per grid point.
std::vector<double> white_noise(std::size_t count, const StreamKey& key) {
  const SamplePoints points(Sampler::philox, key);
  std::vector<double> noise(count);
  for (std::size_t i = 0; i < count; i += 2) {
    const std::array<double, 2> u = points(static_cast<std::uint32_t>(i / 2));
    const double radius = std::sqrt(-2.0 * std::log(u[0]));
    noise[i] = radius * std::cos(2.0 * pi * u[1]);
    if (i + 1 < count) noise[i + 1] = radius * std::sin(2.0 * pi * u[1]);
  }
  return noise;
}

/// Every row of a periodic square convolved with a symmetric kernel, and the square transposed.
std::vector<double> convolved_and_transposed(const std::vector<double>& values, std::size_t side,
                                             const std::vector<double>& kernel) {
  const std::size_t radius = kernel.size() - 1;
  std::vector<double> result(values.size()), row(side + 2 * radius), smooth(side);
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < row.size(); ++x) {
      row[x] = values[y * side + (x + (radius / side + 1) * side - radius) % side];
    }
    for (std::size_t x = 0; x < side; ++x) smooth[x] = kernel[0] * row[x + radius];
    for (std::size_t k = 1; k <= radius; ++k) {
      for (std::size_t x = 0; x < side; ++x) smooth[x] += kernel[k] * (row[x + radius - k] + row[x + radius + k]);
    }
    for (std::size_t x = 0; x < side; ++x) result[x * side + y] = smooth[x];
  }
  return result;
}

}  // namespace

HeightField::HeightField(int cells, std::vector<float> heights) : cells_(cells), heights_(std::move(heights)) {
  if (cells < 2 || cells % 2 != 0 || heights_.size() != static_cast<std::size_t>(cells) * cells) {
    throw Error(ExitCode::usage, "a height field needs an even number of cells and a height for each", "height field",
                "choose an even number of cells");
  }
  const auto [lowest, highest] = std::minmax_element(heights_.begin(), heights_.end());
  lowest_ = *lowest;
  highest_ = *highest;
}

HeightField HeightField::gaussian(int cells, double correlation_length, double alpha, const StreamKey& key) {
  if (!(correlation_length >= 2.0) || !(correlation_length <= 0.25 * cells)) {
    throw Error(ExitCode::usage, "the correlation length must be resolved by cells, and fit the patch several times",
                "height field", "choose 2 to cells/4");
  }
  // A kernel exp(-2r²/ℓ²) leaves the autocorrelation exp(-r²/ℓ²). Seven of its standard deviations ℓ/2 cut it at 2e-11.
  std::vector<double> kernel(static_cast<std::size_t>(std::ceil(3.5 * correlation_length)) + 1);
  for (std::size_t k = 0; k < kernel.size(); ++k) {
    const double r = static_cast<double>(k) / correlation_length;
    kernel[k] = std::exp(-2.0 * r * r);
  }
  const auto side = static_cast<std::size_t>(cells);
  std::vector<double> heights = white_noise(side * side, key);
  for (int axis = 0; axis < 2; ++axis) heights = convolved_and_transposed(heights, side, kernel);

  const auto scaled = [&](double scale) {
    std::vector<float> result(heights.size());
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = static_cast<float>(scale * heights[i]);
    return HeightField(cells, std::move(result));
  };
  const SlopeStatistics unscaled = scaled(1.0).slope_statistics();
  return scaled(alpha / std::hypot(unscaled.rms_x, unscaled.rms_y));
}

std::array<std::array<int, 2>, 3> HeightField::corners(int column, int row, int half) {
  const bool falling = ((column + row) & 1) != 0;  // the diagonal from (0, 1) to (1, 0)
  if (falling) {
    if (half == 0) return {{{0, 0}, {1, 0}, {0, 1}}};
    return {{{1, 0}, {1, 1}, {0, 1}}};
  }
  if (half == 0) return {{{0, 0}, {1, 0}, {1, 1}}};
  return {{{0, 0}, {1, 1}, {0, 1}}};
}

Slope HeightField::slope(std::uint32_t facet) const {
  const int cell = static_cast<int>(facet / 2), half = static_cast<int>(facet % 2);
  const int column = cell % cells_, row = cell / cells_;
  // The legs: the cell's bottom or top edge, and its left or right one.
  const bool falling = ((column + row) & 1) != 0;
  const int across = half, along = falling == (half == 1) ? 1 : 0;
  return {static_cast<double>(height(column + 1, row + across)) - static_cast<double>(height(column, row + across)),
          static_cast<double>(height(column + along, row + 1)) - static_cast<double>(height(column + along, row))};
}

Direction HeightField::normal(std::uint32_t facet) const {
  const Slope s = slope(facet);
  return normalize(Direction{-s.x, -s.y, 1.0});
}

SlopeStatistics HeightField::slope_statistics() const {
  // All facets cover the same macroscopic area. The mean slope of a periodic surface is zero.
  double xx = 0.0, yy = 0.0, xy = 0.0, x4 = 0.0, y4 = 0.0;
  for (std::uint32_t f = 0; f < facets(); ++f) {
    const Slope s = slope(f);
    xx += s.x * s.x, yy += s.y * s.y, xy += s.x * s.y;
    x4 += square(s.x * s.x), y4 += square(s.y * s.y);
  }
  const auto n = static_cast<double>(facets());
  return {.rms_x = std::sqrt(xx / n),
          .rms_y = std::sqrt(yy / n),
          .kurtosis_x = n * x4 / (xx * xx),
          .kurtosis_y = n * y4 / (yy * yy),
          .correlation = xy / std::sqrt(xx * yy)};
}

double HeightField::facing_area(const Direction& w) const {
  double sum = 0.0;
  for (std::uint32_t f = 0; f < facets(); ++f) {
    const Slope s = slope(f);
    sum += max(w.z - s.x * w.x - s.y * w.y, 0.0);
  }
  return sum / static_cast<double>(facets());
}

}  // namespace lobefit
