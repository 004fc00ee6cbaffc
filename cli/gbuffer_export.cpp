#include "cli/gbuffer_export.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cli/fit_job.h"
#include "cli/slice.h"
#include "evaluate/gbuffer_error.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

/// A material and the directions that it is compared over: the table's, or a grid.
struct Scored {
  ParameterValues values;
  Table table;
  std::string grid;
  std::vector<WeightFactor> factors;
  Quantity quantity;
};

/// Settings of the table's axes come first, the others after them.
std::pair<std::vector<std::string>, std::vector<std::string>> split_settings(const std::vector<std::string>& settings,
                                                                             const Table& table) {
  std::vector<std::string> of_axes, others;
  for (const std::string& setting : settings) {
    const bool is_axis = std::ranges::any_of(table.parameter_axes,
                                             [&](const Axis& axis) { return setting.starts_with(axis.name + "="); });
    (is_axis ? of_axes : others).push_back(setting);
  }
  return {of_axes, others};
}

/// Parameters that the axes of the fitted table set have no value of their own. `scored`: over a table whose axes may
/// set them again, or null.
void require_all_set(const ModelChoice& choice, const std::vector<std::string>& settings, const TableModel* scored) {
  if (!choice.fit) return;
  for (const ParameterInfo& info : choice.values.list()) {
    const std::string name(info.name);
    const auto is_it = [&](const FitParameter& p) { return p.name.substr(0, p.name.find('.')) == name; };
    const auto sets_it = [&](const std::string& setting) { return setting.starts_with(name + "="); };
    if (std::ranges::any_of(choice.fit->parameters, is_it) || std::ranges::any_of(settings, sets_it)) continue;
    if (scored && scored->set_by_axis(static_cast<std::size_t>(info.offset))) continue;
    throw Error(ExitCode::usage, "which " + name + "?", "--gbuffer",
                "an axis of the fitted table set it: add --set " + name + "=VALUE");
  }
}

Scored score_on_grid(const GBufferSettings& s) {
  ModelChoice choice = find_model_or_fit(s.name, s.settings);
  require_all_set(choice, s.settings, nullptr);
  return {std::move(choice.values),
          gbuffer_directions(),
          "measured",
          {WeightFactor::sin_theta_i, WeightFactor::sin_theta_o},
          Quantity::log};
}

Scored score_on_table(const GBufferSettings& s, const Context& context) {
  const FitProvenance fitted = is_file(s.name) ? fit_provenance(s.name) : FitProvenance();
  const bool other = !std::filesystem::is_regular_file(s.table) || fitted.table_sha256 != sha256_of_file(s.table);
  const std::string material = s.material.empty() && !other ? fitted.material : s.material;
  const FitTable taken = read_fit_table({s.table, material}, fitted.grid, fitted.weights);
  if (other && !fitted.table_sha256.empty())
    context.say(s.table + " is not the table that " + s.name + " was fitted to");
  const auto [of_axes, others] = split_settings(s.settings, taken.file.table);
  const ModelChoice choice = choose_for_table(s.name, others, {}, taken.file.table);
  const std::size_t row = find_row(taken.file.table, of_axes);
  Scored scored{choice.values, taken.file.table.row_slice(row), taken.grid, taken.weights,
                parse_quantity(fitted.metric)};
  const TableModel on_table(*choice.model, choice.values, taken.file.table, choice.mappings);
  require_all_set(choice, others, &on_table);
  std::ranges::copy(on_table.row(row), scored.values.flat().begin());
  return scored;
}

/// As many numbers as the parameter has, of which one may stand for all.
Json numbers_json(const std::vector<double>& numbers, int components) {
  if (numbers.empty()) return nullptr;
  if (components == 1) return numbers[0];
  return numbers.size() == 1 ? Json{numbers[0], numbers[0], numbers[0]} : Json(numbers);
}

Json parameter_json(const GBufferParameter& parameter, const ParameterInfo& info, const Json& value, double alone) {
  Json line{{"name", parameter.name}, {"value", value}};
  if (parameter.field) {
    const GBufferField& field = *parameter.field;
    line["field"] = {{"place", field.place()},
                     {"engine_name", field.engine_name},
                     {"bits", 8},
                     {"encoding", field.srgb ? "srgb" : "unorm"},
                     {"full", field.full},
                     {"bytes", parameter.bytes},
                     {"rms_log_alone", alone}};
  } else {
    line["field"] = nullptr;
  }
  line["decoded"] = numbers_json(parameter.decoded, info.components);
  line["losses"] = Json::array();
  for (const GBufferLoss& loss : parameter.losses) {
    line["losses"].push_back({{"kind", gbuffer_loss_names[static_cast<std::size_t>(loss.kind)]},
                              {"amount", loss.amount},
                              {"words", loss.words}});
  }
  line["remark"] = parameter.remark;
  return line;
}

Json stages_json(const std::vector<std::pair<const char*, const QuantityErrors*>>& columns) {
  Json json = Json::object();
  for (std::size_t q = 0; q < quantity_names.size(); ++q) {
    for (const auto& [name, errors] : columns) json[std::string(quantity_names[q])][name] = (*errors)[q];
  }
  return json;
}

Json to_json(const GBufferSettings& s, const Scored& scored, const GBufferMaterial& material,
             const GBufferError& error) {
  Json parameters = Json::array();
  const Json values = parameters_json(scored.values);
  for (std::size_t k = 0; k < material.parameters.size(); ++k) {
    const GBufferParameter& parameter = material.parameters[k];
    parameters.push_back(
        parameter_json(parameter, scored.values.info(parameter.name), values.at(parameter.name), error.alone[k]));
  }
  Json pixel = Json::object();
  for (std::size_t t = 0; t < gbuffer_texture_names.size(); ++t)
    pixel[std::string(gbuffer_texture_names[t])] = material.pixel.bytes[t];
  Json errors{{"grid", scored.grid}, {"weights", weight_names(scored.factors)}};
  if (error.against_table) {
    errors["table"] = s.table;
    errors["rms"] = stages_json({{"fit", &error.against_table->fit},
                                 {"port", &error.against_table->port},
                                 {"packed", &error.against_table->packed}});
  }
  errors["differences"] = stages_json({{"port_fit", &error.port_from_fit},
                                       {"packed_port", &error.packed_from_port},
                                       {"packed_fit", &error.packed_from_fit}});
  return {{"model", scored.values.owner()},
          {"static_lighting", s.options.static_lighting},
          {"metallic", s.options.metallic},
          {"params", parameters},
          {"pixel", pixel},
          {"port", {{"model", material.port.owner()}, {"params", parameters_json(material.port)}}},
          {"packed", {{"model", material.decoded.owner()}, {"params", parameters_json(material.decoded)}}},
          {"formula", material.formula},
          {"assumptions", gbuffer_assumptions(s.options)},
          {"error", errors}};
}

constexpr const char* line_format = "  {:<31}  {:<22} {:<24} {:<22} {:>8}  {}\n";

std::string numbers_text(const std::vector<double>& numbers) {
  if (numbers.empty()) return "-";
  std::string text;
  for (const double x : numbers) text += (text.empty() ? "" : " ") + fmt::format("{:.4g}", x);
  return text;
}

std::string parameter_text(const GBufferParameter& parameter, const std::string& value, double alone) {
  std::string stored = "-", by_itself = "-", losses;
  if (parameter.field) {
    stored = fmt::format("{} {}", parameter.field->place(), fmt::join(parameter.bytes, " "));
    by_itself = fmt::format("{:.2g}", alone);
  }
  for (const GBufferLoss& loss : parameter.losses) losses += (losses.empty() ? "" : "; ") + loss.words;
  if (!parameter.remark.empty()) losses += (losses.empty() ? "" : "; ") + parameter.remark;
  std::string line = fmt::format(fmt::runtime(line_format), parameter.name, value, stored,
                                 numbers_text(parameter.decoded), by_itself, losses);
  line.erase(line.find_last_not_of(" \n") + 1);
  return line + "\n";
}

std::string stages_text(const std::vector<std::pair<const char*, const QuantityErrors*>>& columns) {
  std::string text = fmt::format("  {:<10}", "");
  for (const auto& [name, ignored] : columns) text += fmt::format(" {:>14}", name);
  text += "\n";
  for (std::size_t q = 0; q < quantity_names.size(); ++q) {
    text += fmt::format("  {:<10}", quantity_names[q]);
    for (const auto& [ignored, errors] : columns) text += fmt::format(" {:>14.6g}", (*errors)[q]);
    text += "\n";
  }
  return text;
}

std::string to_text(const GBufferSettings& s, const Scored& scored, const GBufferMaterial& material,
                    const GBufferError& error) {
  std::string text =
      fmt::format(fmt::runtime(line_format), scored.values.owner(), "value", "stored", "decoded", "alone", "loss");
  for (std::size_t k = 0; k < material.parameters.size(); ++k) {
    const GBufferParameter& parameter = material.parameters[k];
    const ParameterInfo& info = scored.values.info(parameter.name);
    text += parameter_text(parameter, info.choices.empty() ? numbers_text(parameter.value) : scored.values.text(info),
                           error.alone[k]);
  }
  for (const std::string& difference : material.formula) text += "  formula: " + difference + "\n";
  for (const std::string& assumption : gbuffer_assumptions(s.options)) text += "  assumed: " + assumption + "\n";

  const std::string where =
      fmt::format("grid {}, weights {}", scored.grid,
                  scored.factors.empty() ? "uniform" : fmt::format("{}", fmt::join(weight_names(scored.factors), " ")));
  if (error.against_table) {
    text += fmt::format("\n  rms against {} ({})\n", s.table, where);
    text += stages_text({{"fit", &error.against_table->fit},
                         {"port", &error.against_table->port},
                         {"packed", &error.against_table->packed}});
  }
  text += fmt::format("\n  rms between them ({})\n", where);
  text += stages_text({{"port - fit", &error.port_from_fit},
                       {"packed - port", &error.packed_from_port},
                       {"packed - fit", &error.packed_from_fit}});
  return text;
}

}  // namespace

void export_gbuffer(const GBufferSettings& settings, const Context& context) {
  const Scored scored = settings.table.empty() ? score_on_grid(settings) : score_on_table(settings, context);
  const GBufferMaterial material = gbuffer_material(scored.values, settings.options);
  const GBufferError error =
      gbuffer_error(scored.values, material, scored.table, entry_weights(scored.table, scored.factors, scored.quantity),
                    settings.table.empty());
  write_or_print(context.json ? to_json(settings, scored, material, error).dump(2) + "\n"
                              : to_text(settings, scored, material, error),
                 settings.output, context.force);
}

}  // namespace lobefit
