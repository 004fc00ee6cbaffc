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

/// What intervals are made of: the table's own errors; or how far the result would move had other blocks of directions
/// been measured, for tables that state no errors (cluster-robust over 45 pairs of nine ranges of polar angles, pairs
/// with a range in common dependent).
enum class Intervals { data, blocks };
inline constexpr std::array<std::string_view, 2> intervals_names{"data", "blocks"};

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
  int starts = 1;       // > 1: further starts from a scrambled Sobol sequence
  bool staged = false;  // starts grow from a closed-form guess, lobe by lobe: see fit/starts.h
  bool hops = false;    // staged: lobes of the best start begin anew, see fit/hops.h; several times the work
  /// Starts run on a stratified sample of so many entries, the best two go on over all.
  std::size_t start_entries = 2000;
  /// Of staged fits: pulls what the data leave open to where the model is neutral; moving a parameter over its whole
  /// width costs the square of this share of the misfit.
  double prior = 0.05;
  std::size_t most_entries = 0;            // > 0: fit a stratified sample of so many
  std::vector<ParameterValues> also_from;  // further starts, over all entries: a lower tier's result
  int maximum_iterations = 200;
  double tolerance = 1e-15;     // of the last steps' gain, as a share of the sum of squares
  double holdout = 0.0;         // fraction of entries kept out of the fit to be scored
  bool holdout_blocks = false;  // keep out whole ranges of polar angles: neighbours of a held-out entry tell its value
  Intervals intervals = Intervals::data;
  std::uint64_t seed = 1;  // of starts, samples and held-out entries
};

/// One number of the fitted model: an RGB parameter of a colour table counts three, "albedo.r" and so on.
struct FitParameter {
  std::string name;
  FittedVariable estimate;
  double lower = 0.0, upper = 0.0;
  bool free = false;
};

/// Weights of the entries that a fit uses, and of those that it is scored on: 0 elsewhere, each summing to 1.
struct HeldOut {
  std::vector<double> fitted, held_out;  // held_out is empty without a holdout
};
HeldOut held_out_weights(const Table& table, const FitOptions& options);

/// Its value, errors and bounds, as results list them.
Json estimate_json(const FitParameter& parameter);

struct FitMetric {
  std::string name;
  double value;
};

Json metrics_json(const std::vector<FitMetric>& metrics);

struct Fit {
  std::string model;
  std::vector<FitParameter> parameters;  // those that no axis sets
  std::vector<AxisMapping> mappings;
  std::vector<FitMetric> metrics;  // rms of every quantity over all entries but held-out ones
  std::vector<FitMetric> holdout;  // over the held-out ones
  LeastSquaresSolution solution;   // its variables are the free ones of `parameters`, in their order
  FitOptions options;
  int starts_tried = 1;
  std::vector<double> start_misfits;  // √Σr² at the minimum of each start, over the entries that starts run on
  std::size_t entries = 0;            // that were fitted

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
