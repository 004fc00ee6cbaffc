// What is held against a table, at the table's entries.
//
//   const TableComparison comparison(read_brdf_file("truth.exr"), find_model("eon"), values, {});
//   metrics_report(comparison.pair()).json(comparison.table())
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "report/metrics_report.h"

namespace lobefit {

class TableComparison {
 public:
  /// A model by its own text, axes of the table setting its parameters: see TableModel.
  TableComparison(BrdfFile truth, const Model& model, const ParameterValues& values,
                  const std::vector<AxisMapping>& mappings);
  /// Another file, called `name` in errors: on the same grid, or measured on any, then looked up at the truth's
  /// entries, which are masked where it has no value. Throws Error(invalid_input) for tables of different axes.
  TableComparison(BrdfFile truth, BrdfFile other, const std::string& name);

  const Table& table() const { return truth_->table; }
  const std::vector<float>& values() const { return values_; }
  /// Refers to the comparison.
  BrdfPair pair() const;

 private:
  // By pointer: models and pairs refer to them.
  std::unique_ptr<BrdfFile> truth_, other_;
  std::unique_ptr<TableModel> model_;
  std::vector<float> values_;
};

}  // namespace lobefit
