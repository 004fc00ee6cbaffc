// All reference integrators by name.
#pragma once

#include <span>
#include <string_view>

#include "reference/estimate.h"
#include "reference/integrator.h"
#include "reference/monitor.h"

namespace lobefit {

std::span<const Reference> references();
/// Null if there is none of that name.
const Reference* find_reference_or_null(std::string_view name);
/// Throws Error(usage) with the nearest name.
const Reference& find_reference(std::string_view name);

/// How a Monte Carlo estimate is made.
struct SamplingOptions {
  std::uint64_t samples = 1u << 16;  // of all replicates together
  double stderr_target = 0.0;        // > 0: double the samples until no standard error of f exceeds it
  Sampler sampler = Sampler::sobol;
  std::uint64_t seed = 1;

  /// Samples of one replicate.
  std::uint32_t per_replicate() const;
};

/// Samples of all replicates together never exceed this.
inline constexpr std::uint64_t most_samples = std::uint64_t{1} << 30;

/// Monte Carlo estimate at one pair, in double.
Estimate estimate(const Integrator& integrator, const Direction& wi, const Direction& wo,
                  const SamplingOptions& options, Monitor* monitor = nullptr);

}  // namespace lobefit
