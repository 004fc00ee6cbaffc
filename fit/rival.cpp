#include "fit/rival.h"

#include <algorithm>

namespace lobefit {

namespace {

/// Each row of the table with parameters of its own; with starts, rows follow from one to the next.
std::vector<float> fitted_per_row(const Rival& rival, const ParameterValues& values, const Table& table,
                                  const FitOptions& options, Monitor& monitor) {
  const Model& model = find_model(rival.model);
  std::vector<ParameterValues> starts;
  for (const auto& start : rival.starts) {
    starts.push_back(values);
    for (const auto& [name, value] : start) starts.back().set(name, value);
  }
  std::vector<float> all(table.values.size());
  const std::size_t per_row = table.entries() / table.parameter_rows();
  FitOptions own = options;
  own.also_from = starts;
  for (std::size_t r = 0; r < table.parameter_rows(); ++r) {
    const Table slice = table.row_slice(r);
    const ParameterValues found = fit(model, values, slice, own, monitor).values();
    if (!starts.empty()) {
      own.also_from = starts;
      own.also_from.push_back(found);
    }
    const std::vector<float> part = TableModel(model, found, slice).render().values;
    for (std::size_t c = 0; c < static_cast<std::size_t>(table.channels); ++c) {
      std::copy_n(part.begin() + static_cast<std::ptrdiff_t>(c * per_row), per_row,
                  all.begin() + static_cast<std::ptrdiff_t>(c * table.entries() + r * per_row));
    }
  }
  return all;
}

}  // namespace

RivalScore score(const Rival& rival, const Table& table, Quantity quantity, const std::vector<WeightFactor>& weights,
                 Monitor& monitor) {
  const Model& model = find_model(rival.model);
  ParameterValues values = with_table_parameters(model.defaults(), table);
  for (const auto& [name, components] : rival.set) values.set(name, components);
  FitOptions options{
      .free = rival.free_per_row, .quantity = quantity, .weights = weights, .tolerance = rival.tolerance};
  RivalScore result{.label = rival.label, .rms = 0.0, .values = {}};
  if (!rival.free_per_row.empty()) {
    result.values = fitted_per_row(rival, values, table, options, monitor);
  } else {
    if (!rival.free.empty()) {
      options.free = rival.free;
      options.mappings = rival.mappings;
      values = fit(model, values, table, options, monitor).values();
    }
    result.values = TableModel(model, values, table, rival.mappings).render().values;
  }
  result.rms = rms_difference(table, result.values, quantity, entry_weights(table, weights, quantity));
  return result;
}

}  // namespace lobefit
