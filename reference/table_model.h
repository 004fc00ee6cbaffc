// A model laid over a table's grid: which parameters each row of the table gives it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "models/registry.h"
#include "reference/table.h"

namespace lobefit {

/// Sets a model parameter from a table's parameter axis: parameter = scale × axis^power.
struct AxisMapping {
  std::string parameter, axis;
  double scale = 1.0, power = 1.0;

  double apply(double coordinate) const;
  /// From "NAME=SCALE*AXIS^POWER", scale and power optional: "roughness=0.4*alpha^0.5". Throws Error(usage).
  static AxisMapping parse(std::string_view text);
};

/// A model with one flat parameter set per parameter row of a table.
class TableModel {
 public:
  /// An axis sets the model's parameter of its name, a perceptual roughness its root of the axis alpha; mappings come
  /// first. An axis that reaches no parameter changes nothing: Lambert is the same at every alpha, and EON's own
  /// roughness follows an axis alpha only by a mapping. Throws Error(usage) for a mapping of an axis the table lacks.
  TableModel(const Model& model, const ParameterValues& values, const Table& table,
             const std::vector<AxisMapping>& mappings = {});

  const Model& model() const { return *model_; }
  const std::vector<double>& row(std::size_t parameter_row) const { return rows_[parameter_row]; }
  /// Whether the table's axes set this slot of the flat array.
  bool set_by_axis(std::size_t slot) const { return set_by_axis_[slot]; }
  Rgb evaluate(std::size_t entry) const {
    return model_->evaluate(rows_[table_->parameter_row(entry)], table_->wi(entry), table_->wo(entry));
  }
  /// The model's own table over the same grid, without errors.
  Table render() const;

 private:
  const Model* model_;
  const Table* table_;
  std::vector<std::vector<double>> rows_;
  std::vector<bool> set_by_axis_;
};

/// `values` with every parameter that the table's own provenance states under the same name: a table rendered from a
/// reference with alpha = 0.3 gives the model alpha = 0.3.
ParameterValues with_table_parameters(ParameterValues values, const Table& table);

}  // namespace lobefit
