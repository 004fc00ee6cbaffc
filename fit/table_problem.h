// The entries of a table as a least-squares problem for a model's parameters.
//
// Residuals are √(weight) (quantity(model) - quantity(table)), weights summing to 1.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fit/dual_model.h"
#include "fit/fit.h"
#include "fit/least_squares.h"
#include "reference/table_model.h"

namespace lobefit {

/// The replicate whose numbers fits draw: a table rendered with the same seed has far fewer.
inline constexpr std::uint32_t own_stream = ~0u;

/// Where a fit may move a parameter.
FitBounds bounds_of(const ParameterInfo& info, const FitOptions& options);

/// An intensity and the colour that multiplies it: data know their product alone. A fit of a colour table drives the
/// products; its result has the colour's largest channel at 1.
struct Product {
  std::string_view intensity, tint;
};
/// Those of the models that have both names.
inline constexpr std::array<Product, 3> known_products{{{"diffuse_fresnel", "diffuse_fresnel_tint"},
                                                        {"retroreflection", "retroreflection_tint"},
                                                        {"terminator", "terminator_tint"}}};

/// Which variable of the solver drives which slots of the model's flat parameters.
struct FitVariables {
  std::vector<std::string> names;
  std::vector<std::string> parameters;  // whose variable it is; of a product, its tint
  std::vector<double> lower, upper, start;
  std::vector<double> neutral, width;  // of the prior; width 0: none
  std::vector<int> channel;            // 0, 1, 2 of a colour's channels, -1 where it drives all
  std::vector<int> variable_of_slot;   // -1: not driven
  std::vector<std::size_t> intensity;  // of each product: the slot of its intensity, 1 while its tint is driven
  std::vector<std::size_t> tint;       // of each product: the first slot of its tint

  /// How much of a variable's range is used: an intensity's is far wider than that.
  double range(std::size_t v) const { return std::min(upper[v] - lower[v], 4.0); }
};

/// The unordered pair of ranges, a ninth of the quarter circle each, that two polar angles fall into: reciprocal twins
/// of an entry share its block.
int direction_block(const Direction& wi, const Direction& wo);
std::pair<int, int> ranges_of_block(int block);

/// Whether channel c of the model follows channel c of its colours alone. Found by derivatives at parameters and
/// directions drawn from their ranges.
bool is_channelwise(const Model& model);

class TableProblem {
 public:
  /// Entries with weight take part. Throws Error(usage) for a free parameter that the model lacks or an axis sets.
  TableProblem(const Model& model, const ParameterValues& values, const Table& table, const FitOptions& options,
               const std::vector<double>& weights);

  const FitVariables& variables() const { return variables_; }
  std::size_t entries() const { return residual_count_ / static_cast<std::size_t>(table_.channels); }

  /// The problem from a start. `curvature_sample` gives Σ r ∇²r (see LeastSquaresProblem).
  LeastSquaresProblem problem(std::vector<double> start, const TableProblem* curvature_sample = nullptr) const;
  /// The same by normal equations, with Σ (prior (x - neutral)/width)² added: what the data leave open then stays where
  /// the model is neutral. Colours, roughness and reflectance have no prior.
  LeastSquaresProblem with_prior(std::vector<double> start, double prior) const;

  /// Where the variables stand in a parameter set, and the other way round: products with their intensity 1.
  std::vector<double> variables_of(const ParameterValues& values) const;
  ParameterValues values_at(std::span<const double> x) const;

 private:
  /// Entries of one parameter row, small enough to be one unit of parallel work.
  struct Batch {
    std::size_t parameter_row;
    std::size_t first_residual;
    std::vector<std::size_t> entries;
    std::vector<Direction> wi, wo;
    std::vector<double> root_weight, cos_theta_i;
    std::vector<double> target;  // [channel][entry]: quantity(table)
    std::vector<int> block;      // of FitOptions::Intervals::blocks
  };
  /// Weighted residuals [channel][entry] and their derivatives [channel][entry][lane].
  struct BatchResult {
    std::vector<double> residuals, derivatives;
    std::vector<double> bends;  // of the robust loss
    bool finite = true;
  };

  template <class Work>
  void for_each_batch(Work&& work) const;
  std::vector<double> flat_parameters(const Batch& batch, std::span<const double> x) const;
  BatchResult evaluate_batch(const Batch& batch, std::span<const double> x, bool derivatives) const;
  bool evaluate(std::span<const double> x, std::span<double> residuals, double* jacobian) const;
  bool condense(std::span<const double> x, bool derivatives, NormalEquations& result) const;
  std::vector<double> gradient_covariance(std::span<const double> x) const;
  std::vector<double> data_covariance(std::span<const double> x) const;
  std::vector<double> block_covariance(std::span<const double> x) const;
  /// Adds row (channel c, entry i) of a batch, times `factor`, to g.
  void add_row(const BatchResult& result, std::size_t row, int channel, double factor, double* g) const;

  const Model& model_;
  const DualModel& dual_;
  const Table& table_;
  const FitOptions& options_;
  ParameterValues values_;
  TableModel on_table_;
  FitVariables variables_;
  std::vector<int> lane_of_slot_;  // derivatives: slots of one lane never meet in one channel
  std::vector<std::size_t> lane_of_variable_;
  std::size_t lanes_ = 0;  // a multiple of dual_width
  std::vector<Batch> batches_;
  std::size_t residual_count_ = 0;
  bool has_errors_ = false;
  int range_count_ = 0;  // of polar angles, of which blocks are pairs
};

}  // namespace lobefit
