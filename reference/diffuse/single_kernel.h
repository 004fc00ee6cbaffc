// One configuration of one bounce off Lambertian GGX facets in float: lanes are facets.
#pragma once

#include <span>
#include <vector>

#include "models/microfacet/distribution.h"
#include "reference/sample_points.h"

namespace lobefit {

/// What the facets of a stream of points share, whatever surface they belong to and whatever sees them: points of the
/// unit disk. Made once, used for every configuration.
class DiskPoints {
 public:
  /// The stream's points 0, …, count - 1.
  DiskPoints(const SamplePoints& points, std::uint32_t count);

  std::uint32_t count() const { return count_; }
  std::span<const float> x() const { return x_; }
  std::span<const float> y() const { return y_; }
  /// √(1 - x²): how far the disk reaches in y.
  std::span<const float> edge() const { return edge_; }

 private:
  std::uint32_t count_;
  std::vector<float> x_, y_, edge_;
};

/// Mean of (m·wi)⁺ over the facets m that wo sees: what sample_row() sums for one light. wo above the horizon.
double mean_visible_cosine(const DiskPoints& points, Alpha alpha, const Direction& wo, const Direction& wi);

}  // namespace lobefit
