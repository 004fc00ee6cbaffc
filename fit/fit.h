// Fitting a model to a table.
//
//   FitOptions options{.free = {"a", "b"}, .quantity = Quantity::cosine};
//   const Fit result = fit(find_model("proxima"), values, table, options, monitor);
//
// Parameters that the table's axes set follow the axes; the others are free or keep their value. Residuals are
// √(weight) (quantity(model) - quantity(table)), weights summing to 1, so that the root of their sum of squares is the
// metric itself.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/least_squares.h"
#include "reference/metric.h"
#include "reference/table_model.h"

namespace lobefit {

/// Robust loss applied to each residual of the quantity, inside the batches; `scale` in units of the quantity.
enum class Loss { none, huber, cauchy };
inline constexpr std::array<std::string_view, 3> loss_names{"none", "huber", "cauchy"};

/// Bounds of a free parameter in the place of its own range.
struct FitBounds {
  std::string name;
  double lower, upper;
};

struct FitOptions {
  std::vector<std::string> free;
  std::vector<FitBounds> bounds;  // wider than a parameter's range: Fit::values() refuses what lies outside of that
  std::vector<AxisMapping> mappings;
  Quantity quantity = Quantity::log;
  std::vector<WeightFactor> weights;
  Loss loss = Loss::none;
  double loss_scale = 0.05;
  int starts = 1;  // > 1: further starts from a scrambled Sobol sequence over the ranges
  int maximum_iterations = 200;
  double holdout = 0.0;    // fraction of entries kept out of the fit to be scored
  std::uint64_t seed = 1;  // of starts and held-out entries
};

/// One number of the fitted model: an RGB parameter of a colour table counts three, "albedo.r" and so on.
struct FitParameter {
  std::string name;
  FittedVariable estimate;
  double lower = 0.0, upper = 0.0;
  bool free = false;
};

/// Its value, errors and bounds, as results list them.
Json estimate_json(const FitParameter& parameter);

struct FitMetric {
  std::string name;
  double value;
};

struct Fit {
  std::string model;
  std::vector<FitParameter> parameters;  // those that no axis sets
  std::vector<AxisMapping> mappings;
  std::vector<FitMetric> metrics;  // rms of every quantity over the fitted entries
  std::vector<FitMetric> holdout;  // over the held-out ones
  LeastSquaresSolution solution;
  FitOptions options;
  int starts_tried = 1;

  /// The fitted values, ready to evaluate.
  ParameterValues values() const;
  Json json(const std::string& command, const std::string& table_sha256) const;
  /// From a fit's JSON; throws Error(invalid_input).
  static Fit from_json(const Json& json, const std::string& place);
};

/// Throws Error(usage) for a free parameter that the model lacks or an axis sets, Error(invalid_input) for a table
/// without usable entries.
Fit fit(const Model& model, const ParameterValues& values, const Table& table, const FitOptions& options,
        Monitor& monitor);

/// Parameters of these tiers that no axis of the table sets and that are numbers, not choices.
std::vector<std::string> free_parameters(const ParameterValues& values, const Table& table,
                                         const std::vector<AxisMapping>& mappings, Tier tier);

}  // namespace lobefit
