#include "report/table_comparison.h"

#include <array>

namespace lobefit {

namespace {

/// A file's values at a table's entries, whatever its own grid; where it has none the table is masked.
std::vector<float> values_at_entries(const BrdfFile& file, Table& table) {
  std::vector<float> values(table.values.size());
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (!table.valid[entry]) continue;
    try {
      const Rgb f = file.evaluate(table.wi(entry), table.wo(entry));
      const std::array<double, 3> components{f.x, f.y, f.z};
      for (std::size_t c = 0; c < static_cast<std::size_t>(table.channels); ++c) {
        values[c * table.entries() + entry] = static_cast<float>(components[c]);
      }
    } catch (const Error&) {
      table.valid[entry] = 0;
    }
  }
  return values;
}

}  // namespace

TableComparison::TableComparison(BrdfFile truth, const Model& model, const ParameterValues& values,
                                 const std::vector<AxisMapping>& mappings)
    : truth_(std::make_unique<BrdfFile>(std::move(truth))),
      model_(std::make_unique<TableModel>(model, values, truth_->table, mappings)),
      values_(model_->render().values) {}

TableComparison::TableComparison(BrdfFile truth, BrdfFile other_file, const std::string& name)
    : truth_(std::make_unique<BrdfFile>(std::move(truth))), other_(std::make_unique<BrdfFile>(std::move(other_file))) {
  Table& table = truth_->table;
  const Table& other = other_->table;
  const bool measured = table.coordinates != Coordinates::spherical || other.coordinates != Coordinates::spherical;
  if (measured && !other.same_grid(table) && other.channels == table.channels && other.parameter_rows() == 1) {
    values_ = values_at_entries(*other_, table);
  } else if (!other.same_grid(table) || other.channels != table.channels) {
    throw Error(ExitCode::invalid_input, "the tables have different axes", name,
                "render both over the same grid; `lobefit table info` shows it");
  } else {
    values_ = other.values;
    for (std::size_t entry = 0; measured && entry < table.entries(); ++entry) table.valid[entry] &= other.valid[entry];
  }
}

BrdfPair TableComparison::pair() const {
  if (model_) return model_pair(*truth_, *model_, values_);
  return {.table = &truth_->table,
          .values = values_,
          .truth = row_brdf(*truth_),
          .other = row_brdf(*other_),
          .isotropic = is_isotropic(truth_->table) && is_isotropic(other_->table)};
}

}  // namespace lobefit
