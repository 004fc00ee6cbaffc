// The check: a model as a GPU runs it against the same model in double, and against a table.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/float_device.h"
#include "reference/metric.h"
#include "reference/monitor.h"
#include "reference/table_model.h"

namespace lobefit {

struct CheckOptions {
  std::uint64_t pairs = 1u << 20;
  std::uint64_t seed = 1;
  /// A pair passes if |float - double| ≤ relative_bound |double| + absolute_bound / |cos theta_i|, or by no more than
  /// its float_conditioning() beyond that. The absolute term bounds what reaches the eye, f cos theta_i: forms with a
  /// term in 1/cos theta_i, such as Proxima's, multiply the rounding of everything else by it.
  double relative_bound = 1e-5, absolute_bound = 1e-6;
};

/// Below this value, in 1/sr, an error counts as absolute only.
inline constexpr double smallest_relative_value = 1e-3;

struct CheckTable {
  double rms_double, rms_float;  // of π f cos theta_i against the table, uniform weights
};

struct CheckResult {
  std::string device;
  std::string language;  // of the shader; "" for SIMD code
  bool software = true;
  std::string model;
  std::uint64_t pairs = 0;
  double max_abs = 0.0, max_rel = 0.0, p999_rel = 0.0, rms = 0.0, rms_rel = 0.0;
  /// Of the pairs, how many pass by their conditioning alone.
  std::uint64_t conditioned = 0;
  std::uint64_t failures = 0, non_finite = 0;
  Direction worst_wi, worst_wo;
  ParameterValues worst_parameters;
  double evaluations_per_s = 0.0;
  std::optional<CheckTable> table;
  bool passed = false;

  Json json() const;
};

/// Runs the device over random and hostile pairs (grazing, retro, mirror, normal), cycling through `parameter_sets`.
/// Both sides see the same float32-rounded directions and parameters.
CheckResult check_model(const Model& model, const std::vector<ParameterValues>& parameter_sets,
                        const CheckOptions& options, const FloatDevice& device, Monitor& monitor);

/// The device over a table's own grid.
CheckTable check_against_table(const TableModel& on_table, const Table& table, const FloatDevice& device);

/// `count` parameter sets: `values`, then sets in which every parameter of `vary` is random in its range, each at a
/// bound now and then.
std::vector<ParameterValues> varied_parameters(const ParameterValues& values, const std::vector<std::string>& vary,
                                               int count, std::uint64_t seed);

}  // namespace lobefit
