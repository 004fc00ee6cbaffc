// Two BRDFs to be held against each other, at a table's entries and away from them.
#pragma once

#include <functional>
#include <optional>
#include <span>

#include "reference/table_model.h"

namespace lobefit {

/// A BRDF in 1/sr at any pair of directions, of one parameter row of a table; nothing where it has no value. May be
/// called from several threads at once.
using RowBrdf = std::function<std::optional<Rgb>(std::size_t row, const Direction& wi, const Direction& wo)>;

/// Refers to the model.
inline RowBrdf row_brdf(const TableModel& model) {
  return [&model](std::size_t row, const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    return model.model().evaluate(model.row(row), wi, wo);
  };
}

/// Whether turning both directions about the normal changes nothing.
inline bool is_isotropic(const Table& table) {
  const auto stated = table.parameters.find("isotropic");
  return stated != table.parameters.end() ? *stated == true : table.coordinates != Coordinates::list;
}

/// Two BRDFs to be held against each other: at a table's entries and, where both are known there, at any directions.
struct BrdfPair {
  const Table* table;                        // the truth, where it is valid
  std::span<const float> values;             // of the other at the same entries, as in Table::values
  RowBrdf truth = nullptr, other = nullptr;  // null: known at the entries alone
  bool isotropic = true;                     // both
};

}  // namespace lobefit
