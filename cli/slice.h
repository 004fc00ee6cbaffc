// A part of a table: some axes held, the others kept.
#pragma once

#include "cli/arguments.h"
#include "reference/table.h"

namespace lobefit {

struct Slice {
  const Table* table;
  std::vector<Axis> axes;            // those left, slowest first
  std::vector<std::size_t> entries;  // in the order of the axes

  std::string csv() const;
  /// Mean of the channels of π f cos theta_i, the last axis along a line; NaN where masked.
  std::vector<float> cosine_picture() const;
};

/// Holds every AXIS=VALUE of `held`; axes with a single value hold themselves. Throws Error(usage).
Slice cut(const Table& table, const std::vector<std::string>& held);

/// A model or fit for a table: its parameters are the fit's, else those of the table's provenance, then `settings`.
ModelChoice choose_for_table(const std::string& name, const std::vector<std::string>& settings,
                             const std::vector<std::string>& mappings, const Table& table);

}  // namespace lobefit
