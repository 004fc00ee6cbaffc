// Few entries that stand for many.
#pragma once

#include <cstdint>
#include <vector>

#include "reference/metric.h"

namespace lobefit {

/// Systematic sampling along the table, an entry's probability proportional to its weight times the mean plus its own
/// quantity (Horvitz & Thompson 1952), so that a narrow highlight is not lost.
class EntrySampler {
 public:
  EntrySampler(const Table& table, const std::vector<double>& weights, Quantity quantity);

  /// Weights of a sample of about `count` entries, the others 0, summing to 1: sums over the sample stand for sums over
  /// all. All weights where there are no more entries than that.
  std::vector<double> sample(std::size_t count, std::uint64_t seed) const;

 private:
  std::vector<double> weights_, importance_;
  std::size_t with_weight_;
};

}  // namespace lobefit
