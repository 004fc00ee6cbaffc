#include "cli/slice.h"

#include <fmt/format.h>

namespace lobefit {

Slice cut(const Table& table, const std::vector<std::string>& held) {
  std::vector<Axis> all = table.parameter_axes;
  all.push_back(table.grid.theta_o);
  all.push_back(table.grid.theta_i);
  all.push_back(table.grid.phi);
  std::vector<int> fixed(all.size(), -1);
  for (const std::string& text : held) {
    const std::string name = text.substr(0, text.find('='));
    const auto axis =
        std::find_if(all.begin(), all.end(), [&](const Axis& candidate) { return candidate.name == name; });
    if (axis == all.end() || name.size() + 1 >= text.size()) {
      std::vector<std::string> names;
      for (const Axis& candidate : all) names.push_back(candidate.name);
      throw Error(ExitCode::usage, "no axis in '" + text + "'", "--at",
                  "did you mean '" + nearest_name(name, names) + "=VALUE'?");
    }
    const double value = parse_number(std::string_view(text).substr(name.size() + 1), "--at " + name);
    std::size_t nearest = 0;
    for (std::size_t i = 1; i < axis->size(); ++i) {
      if (std::abs(axis->values[i] - value) < std::abs(axis->values[nearest] - value)) nearest = i;
    }
    if (std::abs(axis->values[nearest] - value) > 1e-9 * max(1.0, std::abs(value))) {
      throw Error(ExitCode::usage, name + " = " + number_text(value) + " is no value of the axis", "--at",
                  "the nearest is " + number_text(axis->values[nearest]));
    }
    fixed[static_cast<std::size_t>(axis - all.begin())] = static_cast<int>(nearest);
  }
  Slice slice{.table = &table};
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (fixed[i] < 0 && all[i].size() > 1) slice.axes.push_back(all[i]);
  }
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    std::size_t rest = entry;
    // An entry's number: parameter axes, then theta_o, theta_i, phi, the last running fastest.
    bool inside = true;
    for (std::size_t i = all.size(); i-- > 0;) {
      const std::size_t index = rest % all[i].size();
      rest /= all[i].size();
      inside = inside && (fixed[i] < 0 || static_cast<std::size_t>(fixed[i]) == index);
    }
    if (inside) slice.entries.push_back(entry);
  }
  return slice;
}

std::string Slice::csv() const {
  std::string text;
  for (const Axis& axis : axes) text += axis.name + ",";
  text += table->channels == 1 ? "f,stderr,valid\n" : "r,g,b,stderr_r,stderr_g,stderr_b,valid\n";
  for (std::size_t k = 0; k < entries.size(); ++k) {
    std::string row;
    std::size_t rest = k;
    for (std::size_t i = axes.size(); i-- > 0;) {
      row.insert(0, number_text(axes[i].values[rest % axes[i].size()]) + ",");
      rest /= axes[i].size();
    }
    for (int c = 0; c < table->channels; ++c) row += fmt::format("{},", table->value(entries[k], c));
    for (int c = 0; c < table->channels; ++c) row += fmt::format("{},", table->standard_error(entries[k], c));
    text += row + (table->valid[entries[k]] ? "1\n" : "0\n");
  }
  return text;
}

std::vector<float> Slice::cosine_picture() const {
  std::vector<float> picture;
  for (const std::size_t entry : entries) {
    double sum = 0.0;
    for (int c = 0; c < table->channels; ++c) sum += table->value(entry, c);
    picture.push_back(table->valid[entry] ? static_cast<float>(pi * table->wi(entry).z * sum / table->channels)
                                          : std::numeric_limits<float>::quiet_NaN());
  }
  return picture;
}

ModelChoice choose_for_table(const std::string& name, const std::vector<std::string>& settings,
                             const std::vector<std::string>& mappings, const Table& table) {
  ModelChoice choice = find_model_or_fit(name, {});
  if (!choice.fit) choice.values = with_table_parameters(choice.values, table);
  set_parameters(choice.values, settings);
  for (const std::string& text : mappings) choice.mappings.push_back(AxisMapping::parse(text));
  return choice;
}

}  // namespace lobefit
