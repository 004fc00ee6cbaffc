// What recipes share in reading and writing: parameters by name, complaints about usage turned into complaints about a
// file, references.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "reference/json_reader.h"

namespace lobefit {

inline std::vector<double> number_or_numbers(const JsonReader& reader) {
  return reader.value().is_array() ? reader.numbers() : std::vector{reader.number()};
}

/// Runs `read`, whose complaints about usage become complaints about the place in the file.
template <class Read>
auto in_file(const JsonReader& reader, Read&& read) {
  try {
    return read();
  } catch (const Error& error) {
    if (error.code() != ExitCode::usage) throw;
    throw error.inside(ExitCode::invalid_input, reader.path());
  }
}

/// Sets parameters from a JSON object; a wrong name or value is reported with its path.
inline void set_parameters(ParameterValues& values, const JsonReader& reader) {
  for (const auto& [name, member] : reader.members()) {
    in_file(member, [&, &name = name, &member = member] {
      if (member.value().is_string()) {
        values.set_text(name, member.text());
      } else {
        values.set(name, number_or_numbers(member));
      }
      return 0;
    });
  }
}

/// Runs `read`, whose complaints get the file's name if they lack it.
template <class Read>
auto naming_file(const std::filesystem::path& path, Read&& read) {
  try {
    return read();
  } catch (const Error& error) {
    const std::string message = error.what();
    if (message.find(path.string()) != std::string::npos) throw;
    throw error.inside(error.code(), path.string());
  }
}

/// A reference and its named choices, as results state it.
inline Json reference_json(const std::string& name, const ParameterValues& values) {
  Json json{{"name", name}};
  for (const ParameterInfo& info : values.list()) {
    if (!info.choices.empty()) json[std::string(info.name)] = std::string(values.choice(info.name));
  }
  return json;
}

}  // namespace lobefit
