// All reference integrators by name.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "models/parameter.h"
#include "reference/estimate.h"
#include "reference/monitor.h"
#include "reference/sample_points.h"

namespace lobefit {

/// A registered reference: ground truth by integration.
struct Reference {
  std::string_view name, doc, source;
  std::vector<ParameterInfo> parameters;
  /// BRDF by quadrature.
  Rgb (*exact)(std::span<const double> flat, const Direction& wi, const Direction& wo);
  /// Mean BRDFs of one stream of sample points for a line of lights, which share the sampled facets. `fast`: in float,
  /// vectorised over the lights.
  void (*sample_row)(std::span<const double> flat, const Direction& wo, std::span<const Direction> wi,
                     const SamplePoints& points, std::uint32_t samples, bool fast, std::span<Rgb> values);

  ParameterValues defaults() const { return ParameterValues(parameters, std::string(name)); }
};

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
Estimate estimate(const Reference& reference, std::span<const double> flat, const Direction& wi, const Direction& wo,
                  const SamplingOptions& options, Monitor* monitor = nullptr);

}  // namespace lobefit
