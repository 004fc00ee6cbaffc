// The Smith random walk on Lambertian GGX facets in float, many paths at once.
#pragma once

#include <span>
#include <vector>

#include "models/geometry.h"
#include "models/microfacet/distribution.h"
#include "reference/sample_points.h"

namespace lobefit {

/// Lights sorted into lanes: those with one Λ side by side, so that one shadowing factor serves them all.
class LightLanes {
 public:
  LightLanes(Distribution distribution, Alpha alpha, std::span<const Direction> wi);

  /// sums[light] += Σ over facets of (m·wi)⁺ exp(-Λi τ); without `tau`, of (m·wi)⁺ alone.
  void add(std::span<const float> mx, std::span<const float> my, std::span<const float> mz, std::span<const float> tau,
           std::span<double> sums);

 private:
  struct Group {
    std::size_t first, lanes, first_light, lights;
    float lambda;
  };
  std::vector<Group> groups_;
  std::vector<float> x_, y_, z_;     // one layout for all lights in their order …
  std::vector<float> gx_, gy_, gz_;  // … and one with every group on whole vectors
  std::vector<float> lane_sums_;
  std::vector<float> scaled_x_, scaled_y_, scaled_z_;
};

/// Paths that were scattered once, as arrays: the facets m they met, and the numbers they draw from. `advance` takes
/// those that do not escape to their next facet.
class WalkLanes {
 public:
  WalkLanes(Alpha alpha, const SamplePoints& points) : alpha_(alpha), points_(&points) {}

  /// Paths number first, first + 1, … on the facets of order 1; their depths are drawn here. `lambda`: of the view.
  void start(std::uint32_t first, std::span<const float> mx, std::span<const float> my, std::span<const float> mz,
             double lambda);
  /// One more bounce: scatters, flies, meets the next facet. Returns how many paths are left.
  std::size_t advance();

  std::span<const float> mx() const { return std::span(mx_).first(count_); }
  std::span<const float> my() const { return std::span(my_).first(count_); }
  std::span<const float> mz() const { return std::span(mz_).first(count_); }
  std::span<const float> tau() const { return std::span(tau_).first(count_); }

 private:
  void resize(std::size_t n);

  Alpha alpha_;
  const SamplePoints* points_;
  std::size_t count_ = 0;
  std::uint32_t pair_ = 1;  // pair 0 chose the first facet
  std::vector<std::uint32_t> index_, kept_;
  std::vector<float> mx_, my_, mz_, wx_, wy_, wz_, tau_, spare_, u_, v_, s_, t_;
};

}  // namespace lobefit
