// Monte Carlo estimates with honest errors.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "models/scalar.h"

namespace lobefit {

/// Replicates behind every standard error: independent scrambles of the same point set. Their spread needs no
/// assumption about the points, and leaves 31 degrees of freedom.
inline constexpr int replicate_count = 32;

struct MeanAndError {
  double mean = 0.0, standard_error = 0.0;
};

/// A value with its standard error; `samples` counts all replicates together. method: "monte_carlo" or "exact".
struct Estimate {
  Rgb f, stderr_f;
  std::vector<MeanAndError>
      orders;  // what each order adds per unit of albedo to its power, where orders are kept apart
  std::uint64_t samples = 0;
  std::string_view method;
};

/// Mean of the replicates, and the standard error of that mean.
template <class T>
MeanAndError mean_and_error(std::span<const T> replicates) {
  const auto n = static_cast<double>(replicates.size());
  double sum = 0.0;
  for (const T x : replicates) sum += x;
  const double mean = sum / n;
  double squares = 0.0;
  for (const T x : replicates) squares += (x - mean) * (x - mean);
  return {mean, std::sqrt(squares / (n * (n - 1.0)))};
}

}  // namespace lobefit
