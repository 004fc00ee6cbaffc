#include "reference/table_model.h"

#include <algorithm>

#include "reference/json_reader.h"

namespace lobefit {

AxisMapping AxisMapping::parse(std::string_view text) {
  const auto fail = [&]() {
    return Error(ExitCode::usage, "'" + std::string(text) + "' is not a mapping", "--map",
                 "write NAME=SCALE*AXIS^POWER, such as roughness=0.4*alpha^0.5");
  };
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0) throw fail();
  AxisMapping mapping;
  mapping.parameter = text.substr(0, equals);
  std::string_view rest = text.substr(equals + 1);
  if (const std::size_t star = rest.find('*'); star != std::string_view::npos) {
    mapping.scale = parse_number(rest.substr(0, star), "--map");
    rest = rest.substr(star + 1);
  }
  if (const std::size_t caret = rest.find('^'); caret != std::string_view::npos) {
    mapping.power = parse_number(rest.substr(caret + 1), "--map");
    rest = rest.substr(0, caret);
  }
  if (rest.empty()) throw fail();
  mapping.axis = rest;
  return mapping;
}

double AxisMapping::apply(double coordinate) const { return scale * std::pow(coordinate, power); }

TableModel::TableModel(const Model& model, const ParameterValues& values, const Table& table,
                       const std::vector<AxisMapping>& mappings)
    : model_(&model), table_(&table), set_by_axis_(values.flat().size(), false) {
  std::vector<AxisMapping> all = mappings;
  for (const Axis& axis : table.parameter_axes) {
    const auto mapped = [&](const AxisMapping& mapping) { return mapping.axis == axis.name; };
    if (std::any_of(mappings.begin(), mappings.end(), mapped)) continue;
    if (values.has(axis.name)) {
      all.push_back({axis.name, axis.name});
      continue;
    }
    const auto rough = std::find_if(values.list().begin(), values.list().end(),
                                    [](const ParameterInfo& info) { return info.perceptual_roughness; });
    if (axis.name == "alpha" && rough != values.list().end())
      all.push_back({std::string(rough->name), "alpha", 1.0, 0.5});
    // A model without roughness, such as Lambert, is the same in every row.
  }
  for (const AxisMapping& mapping : all) {
    const ParameterInfo& info = values.info(mapping.parameter);
    for (int i = 0; i < info.components; ++i) set_by_axis_[static_cast<std::size_t>(info.offset + i)] = true;
  }
  for (std::size_t row = 0; row < table.parameter_rows(); ++row) {
    ParameterValues at_row = values;
    const std::vector<double> coordinates = table.parameter_values(row);
    for (const AxisMapping& mapping : all) {
      const auto axis = std::find_if(table.parameter_axes.begin(), table.parameter_axes.end(),
                                     [&](const Axis& candidate) { return candidate.name == mapping.axis; });
      if (axis == table.parameter_axes.end()) {
        throw Error(ExitCode::usage, "the table has no axis '" + mapping.axis + "'", "--map " + mapping.parameter,
                    "`lobefit table info` lists its axes");
      }
      const double coordinate = coordinates[static_cast<std::size_t>(axis - table.parameter_axes.begin())];
      at_row.set(mapping.parameter, mapping.apply(coordinate));
    }
    rows_.emplace_back(at_row.flat().begin(), at_row.flat().end());
  }
}

Table TableModel::render() const {
  std::vector<float> values(table_->values.size());
  for (std::size_t entry = 0; entry < table_->entries(); ++entry) {
    // Bins of measured grids may lie under the surface, where models have no value.
    if (table_->coordinates != Coordinates::spherical && !table_->valid[entry]) continue;
    const Rgb f = evaluate(entry);
    const std::array<double, 3> components{f.x, f.y, f.z};
    for (std::size_t c = 0; c < static_cast<std::size_t>(table_->channels); ++c) {
      values[c * table_->entries() + entry] = static_cast<float>(components[c]);
    }
  }
  return table_->with_values(std::string(model_->info->name), std::move(values));
}

ParameterValues with_table_parameters(ParameterValues values, const Table& table) {
  for (const auto& [name, value] : table.parameters.items()) {
    if (!values.has(name) || value.is_string()) continue;
    const JsonReader reader(value, "the table's parameters", "$." + name);
    try {
      values.set(name, value.is_array() ? reader.numbers() : std::vector{reader.number()});
    } catch (const Error& error) {
      throw error.code() == ExitCode::usage ? error.inside(ExitCode::invalid_input, "the table's parameters") : error;
    }
  }
  return values;
}

}  // namespace lobefit
