// Monte Carlo estimates of colours by independent scrambles, with the standard error of their mean.
#pragma once

#include <tbb/parallel_for.h>

#include <array>
#include <functional>
#include <span>

#include "reference/estimate.h"
#include "reference/sample_points.h"

namespace lobefit {

struct RgbEstimate {
  std::array<MeanAndError, 3> channel;

  double mean() const { return channel[0].mean; }
  double error() const { return channel[0].standard_error; }
  /// Distance to the truth in standard errors.
  double distance(double truth) const { return (mean() - truth) / error(); }
};

inline RgbEstimate summarise(const std::array<Rgb, replicate_count>& values) {
  RgbEstimate result;
  for (std::size_t c = 0; c < 3; ++c) {
    std::array<double, replicate_count> column;
    for (std::size_t r = 0; r < replicate_count; ++r) {
      column[r] = c == 0 ? values[r].x : c == 1 ? values[r].y : values[r].z;
    }
    result.channel[c] = mean_and_error(std::span<const double>(column));
  }
  return result;
}

/// `each(points)` for every replicate.
inline RgbEstimate replicates(std::uint64_t seed, const std::function<Rgb(const SamplePoints&)>& each) {
  std::array<Rgb, replicate_count> values;
  tbb::parallel_for(std::uint32_t{0}, std::uint32_t{replicate_count}, [&](std::uint32_t r) {
    values[r] = each(SamplePoints(Sampler::sobol, {seed, 0, r}));
  });
  return summarise(values);
}

}  // namespace lobefit
