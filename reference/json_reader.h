// Reading JSON that a person wrote: every complaint names the file and the path inside it.
#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "models/error.h"
#include "models/parameter.h"

namespace lobefit {

using Json = nlohmann::ordered_json;

/// Throws Error(invalid_input) with the position of a syntax error.
inline Json parse_json(const std::string& text, const std::string& place) {
  try {
    return Json::parse(text);
  } catch (const Json::out_of_range&) {
    throw Error(ExitCode::invalid_input, "a number is too large", place, "write finite numbers");
  } catch (const Json::parse_error& error) {
    const std::size_t byte = std::min(error.byte == 0 ? 0 : error.byte - 1, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(byte), '\n');
    throw Error(ExitCode::invalid_input, "not valid JSON", place + ", line " + std::to_string(line),
                "look for a missing comma, quote or bracket");
  }
}

/// A value inside a JSON document.
class JsonReader {
 public:
  JsonReader(const Json& value, std::string place, std::string path = "$")
      : value_(&value), place_(std::move(place)), path_(std::move(path)) {}

  const Json& value() const { return *value_; }
  const std::string& path() const { return path_; }

  Error error(const std::string& what, const std::string& mend) const {
    return {ExitCode::invalid_input, what, place_ + ", " + path_, mend};
  }

  bool has(std::string_view key) const { return object().contains(std::string(key)); }
  JsonReader at(std::string_view key) const {
    const auto found = object().find(std::string(key));
    if (found == value_->end()) throw error("missing '" + std::string(key) + "'", "add it");
    return {*found, place_, path_ + "." + std::string(key)};
  }
  /// Refuses keys that are not in `keys`.
  void allow(std::initializer_list<std::string_view> keys) const {
    const std::vector<std::string> known(keys.begin(), keys.end());
    for (const auto& [key, ignored] : object().items()) {
      if (std::find(known.begin(), known.end(), key) == known.end()) {
        throw error("unknown key '" + key + "'", "did you mean '" + nearest_name(key, known) + "'?");
      }
    }
  }
  std::vector<JsonReader> elements() const {
    if (!value_->is_array()) throw error("expected a list", "write [ … ]");
    std::vector<JsonReader> result;
    for (const Json& element : *value_) {
      result.emplace_back(element, place_, path_ + "[" + std::to_string(result.size()) + "]");
    }
    return result;
  }
  std::vector<std::pair<std::string, JsonReader>> members() const {
    std::vector<std::pair<std::string, JsonReader>> result;
    for (const auto& [key, member] : object().items()) {
      result.emplace_back(key, JsonReader(member, place_, path_ + "." + key));
    }
    return result;
  }

  double number() const {
    if (!value_->is_number()) throw error("expected a number", "write a number without quotes");
    return value_->get<double>();
  }
  bool boolean() const {
    if (!value_->is_boolean()) throw error("expected true or false", "write it without quotes");
    return value_->get<bool>();
  }
  std::string text() const {
    if (!value_->is_string()) throw error("expected a text", "write it in quotes");
    return value_->get<std::string>();
  }
  std::vector<double> numbers() const {
    std::vector<double> result;
    for (const JsonReader& element : elements()) result.push_back(element.number());
    if (result.empty()) throw error("the list is empty", "give at least one number");
    return result;
  }

 private:
  const Json& object() const {
    if (!value_->is_object()) throw error("expected an object", "write { … }");
    return *value_;
  }

  const Json* value_;
  std::string place_, path_;
};

/// Throws Error(invalid_input) unless the list holds increasing angles from 0 to `upper`, itself included if `closed`.
void check_angles(const JsonReader& reader, double upper, bool closed);

}  // namespace lobefit
