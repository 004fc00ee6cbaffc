#include "cli/arguments.h"

#include <fmt/format.h>

#include <cstdio>

#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "reference/table_row.h"

namespace lobefit {

void set_parameters(ParameterValues& values, const std::vector<std::string>& settings) {
  for (const std::string& setting : settings) {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw Error(ExitCode::usage, "'" + setting + "' is not a setting", "--set", "write NAME=VALUE");
    }
    values.set_text(setting.substr(0, equals), std::string_view(setting).substr(equals + 1));
  }
}

std::vector<Axis> parse_axes(const std::vector<std::string>& texts) {
  std::vector<Axis> axes;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw Error(ExitCode::usage, "'" + text + "' is not an axis", "--axis", "write NAME=v1,v2,…");
    }
    const std::string name = text.substr(0, equals);
    for (const Axis& axis : axes) {
      if (axis.name == name)
        throw Error(ExitCode::usage, "axis '" + name + "' is given twice", "--axis", "give it once");
    }
    axes.push_back({name, "", parse_numbers(std::string_view(text).substr(equals + 1), "--axis " + name), false});
  }
  return axes;
}

Direction parse_direction(const std::string& text, const char* option, bool sphere) {
  const std::vector<double> angles = parse_numbers(text, option);
  if (angles.size() != 2) {
    throw Error(ExitCode::usage, "expected two angles, got " + std::to_string(angles.size()), option,
                "write THETA,PHI in degrees");
  }
  if (sphere && !(angles[0] >= 0.0 && angles[0] <= 180.0)) {
    throw Error(ExitCode::usage, "theta = " + number_text(angles[0]) + " is out of range", option,
                "choose an angle from 0 to 180 degrees");
  }
  if (!sphere && !(angles[0] >= 0.0 && angles[0] < 90.0)) {
    throw Error(ExitCode::usage, "theta = " + number_text(angles[0]) + " is out of range", option,
                "choose an angle from 0 to below 90 degrees: directions lie above the surface");
  }
  return direction(radians(angles[0]), radians(angles[1]));
}

Json rgb_json(const Rgb& value, int channels) {
  return channels == 1 ? Json{value.x} : Json{value.x, value.y, value.z};
}

std::string rgb_text(const Rgb& value, int channels) {
  return channels == 1 ? fmt::format("{:.9g}", value.x)
                       : fmt::format("{:.9g}  {:.9g}  {:.9g}", value.x, value.y, value.z);
}

bool is_file(const std::string& name) {
  std::error_code ignored;
  return name.find('/') != std::string::npos || name.find('.') != std::string::npos ||
         std::filesystem::is_regular_file(name, ignored);
}

void write_or_print(const std::string& text, const std::string& output, bool force) {
  if (output.empty() || output == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return;
  }
  OutputFile file(output, force);
  file.write(text);
  file.commit();
}

Json parameters_json(const ParameterValues& values) {
  Json json = Json::object();
  for (const ParameterInfo& info : values.list()) {
    const std::span<const double> slots = values.components(info);
    Json& member = json[std::string(info.name)];
    if (info.file) {
      member = values.path(info.name);
    } else if (!info.choices.empty()) {
      member = std::string(values.choice(info.name));
    } else if (info.components == 1) {
      member = slots[0];
    } else {
      member = std::vector<double>(slots.begin(), slots.end());
    }
  }
  return json;
}

std::size_t find_row(const Table& table, const std::vector<std::string>& settings) {
  std::vector<AxisValue> wanted;
  for (const std::string& setting : settings) {
    const std::string name = setting.substr(0, setting.find('='));
    if (name.size() + 1 >= setting.size())
      throw Error(ExitCode::usage, "'" + setting + "' is not a setting", "--set", "write AXIS=VALUE");
    wanted.push_back({name, parse_number(std::string_view(setting).substr(name.size() + 1), "--set " + name)});
  }
  return find_row(table, wanted);
}

Source find_source(const std::string& name, const std::vector<std::string>& settings) {
  if (const Reference* reference = find_reference_or_null(name)) {
    ParameterValues values = reference->defaults();
    set_parameters(values, settings);
    const std::shared_ptr<const Integrator> integrator = reference->make(values);
    return {name,
            integrator->channels(),
            reference->sphere,
            [integrator](const Direction& wi, const Direction& wo) { return integrator->exact(wi, wo); },
            parameters_json(values),
            integrator,
            reference->fibre};
  }
  if (is_file(name)) {
    const auto file = std::make_shared<BrdfFile>(read_brdf_file(name));
    const Table& table = file->table;
    const std::size_t row = find_row(table, settings);
    Json parameters = table.parameters;
    const std::vector<double> coordinates = table.parameter_values(row);
    for (std::size_t i = 0; i < coordinates.size(); ++i) parameters[table.parameter_axes[i].name] = coordinates[i];
    Source source{name, table.channels, table.reaches_below(),
                  [file, row](const Direction& wi, const Direction& wo) { return file->evaluate(wi, wo, row); },
                  parameters};
    source.isotropic = is_isotropic(table);
    if (file->rgl) source.albedo_of_light = [file](double theta) { return file->rgl->albedo_of_light(theta); };
    return source;
  }
  const Model& model = find_model(name);
  ParameterValues values = model.defaults();
  set_parameters(values, settings);
  const bool hair = is_hair(model.info->kind);
  return {name,
          3,
          hair || model.info->transmits,
          [&model, values](const Direction& wi, const Direction& wo) { return model.evaluate(values.flat(), wi, wo); },
          parameters_json(values),
          nullptr,
          hair,
          model.info->isotropic,
          nullptr,
          &model,
          {values.flat().begin(), values.flat().end()}};
}

std::function<std::optional<Rgb>(const Direction& wi, const Direction& wo)> brdf_of(const Source& source) {
  if (source.integrator) {
    if (!source.integrator->has_exact()) {
      throw Error(ExitCode::usage, "the reference is known by Monte Carlo alone", source.label,
                  "render a table of it, and give that");
    }
    return [evaluate = source.evaluate](const Direction& wi, const Direction& wo) {
      return std::optional<Rgb>(evaluate(wi, wo));
    };
  }
  return [evaluate = source.evaluate](const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    try {
      return evaluate(wi, wo);
    } catch (const Error&) {
      return std::nullopt;
    }
  };
}

ModelChoice find_model_or_fit(const std::string& name, const std::vector<std::string>& settings) {
  ModelChoice choice;
  if (is_file(name)) {
    const Json json = parse_json(read_file(name), name);
    choice.fit = Fit::from_json(json, name);
    choice.model = &find_model(choice.fit->model);
    choice.values = choice.fit->values();
    choice.mappings = choice.fit->mappings;
  } else {
    choice.model = &find_model(name);
    choice.values = choice.model->defaults();
  }
  set_parameters(choice.values, settings);
  return choice;
}

}  // namespace lobefit
