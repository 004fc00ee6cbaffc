#include "models/parameter.h"

#include <algorithm>
#include <charconv>
#include <numeric>

namespace lobefit {

namespace {

int edit_distance(std::string_view a, std::string_view b) {
  std::vector<int> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = static_cast<int>(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const int substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

}  // namespace

std::string nearest_name(std::string_view name, std::span<const std::string> names) {
  const auto nearest =
      std::ranges::min_element(names, {}, [&](const std::string& n) { return edit_distance(name, n); });
  return nearest == names.end() ? "" : *nearest;
}

double parse_number(std::string_view text, std::string_view what) {
  double value = 0.0;
  // from_chars knows no plus sign.
  const char* begin = text.data() + (text.starts_with('+') && !text.starts_with("+-") ? 1 : 0);
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(begin, end, value);
  if (code != std::errc{} || rest != end || !std::isfinite(value)) {
    throw Error(ExitCode::usage, "'" + std::string(text) + "' is not a finite number", std::string(what),
                "write a decimal number such as 0.5");
  }
  return value;
}

std::vector<double> parse_numbers(std::string_view text, std::string_view what) {
  std::vector<double> numbers;
  std::size_t begin = 0;
  while (true) {
    const std::size_t comma = text.find(',', begin);
    numbers.push_back(parse_number(text.substr(begin, comma - begin), what));
    if (comma == std::string_view::npos) return numbers;
    begin = comma + 1;
  }
}

std::string number_text(double value) {
  std::array<char, 32> buffer;
  const auto [end, code] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end};
}

ParameterValues::ParameterValues(std::vector<ParameterInfo> list, std::string owner)
    : list_(std::move(list)), owner_(std::move(owner)) {
  for (const ParameterInfo& info : list_)
    flat_.insert(flat_.end(), static_cast<std::size_t>(info.components), info.initial);
}

bool ParameterValues::has(std::string_view name) const {
  return std::any_of(list_.begin(), list_.end(), [&](const ParameterInfo& info) { return info.name == name; });
}

const ParameterInfo& ParameterValues::info(std::string_view name) const {
  std::vector<std::string> names;
  for (const ParameterInfo& info : list_) {
    if (info.name == name) return info;
    names.emplace_back(info.name);
  }
  throw Error(ExitCode::usage, "unknown parameter '" + std::string(name) + "'", owner_,
              "did you mean '" + nearest_name(name, names) + "'?");
}

void ParameterValues::set(std::string_view name, std::span<const double> components) {
  const ParameterInfo& parameter = info(name);
  const std::string where = owner_ + ", parameter " + std::string(name);
  const auto count = static_cast<std::size_t>(parameter.components);
  if (parameter.file) throw Error(ExitCode::usage, "expected a file, got a number", where, "write NAME=FILE");
  if (components.size() != 1 && components.size() != count) {
    throw Error(ExitCode::usage,
                "expected " + (count == 1 ? std::string("one number") : "one number or three") + ", got " +
                    std::to_string(components.size()),
                where, count == 1 ? "write NAME=VALUE" : "write NAME=VALUE or NAME=r,g,b");
  }
  for (const double value : components) {
    // Written so that NaN fails too.
    if (!(value >= parameter.lower && value <= parameter.upper)) {
      throw Error(ExitCode::usage, number_text(value) + " is out of range", where,
                  "choose a value from " + number_text(parameter.lower) + " to " + number_text(parameter.upper));
    }
  }
  if (!parameter.choices.empty() && components[0] != std::floor(components[0])) {
    throw Error(ExitCode::usage, number_text(components[0]) + " is not a choice", where, "name one of the choices");
  }
  for (std::size_t i = 0; i < count; ++i) {
    flat_[static_cast<std::size_t>(parameter.offset) + i] = components[components.size() == 1 ? 0 : i];
  }
}

void ParameterValues::set_text(std::string_view name, std::string_view text) {
  const ParameterInfo& parameter = info(name);
  const std::string where = owner_ + ", parameter " + std::string(name);
  if (parameter.file) {
    paths_[std::string(name)] = text;
    return;
  }
  if (parameter.choices.empty()) {
    set(name, parse_numbers(text, where));
    return;
  }
  std::string allowed;
  for (std::size_t i = 0; i < parameter.choices.size(); ++i) {
    if (parameter.choices[i] == text) {
      set(name, static_cast<double>(i));
      return;
    }
    allowed += (i == 0 ? "" : ", ") + std::string(parameter.choices[i]);
  }
  throw Error(ExitCode::usage, "'" + std::string(text) + "' is not a choice", where, "choose one of " + allowed);
}

std::string_view ParameterValues::choice(std::string_view name) const {
  const ParameterInfo& parameter = info(name);
  return parameter.choices[static_cast<std::size_t>(flat_[static_cast<std::size_t>(parameter.offset)])];
}

std::string ParameterValues::path(std::string_view name) const {
  const auto found = paths_.find(info(name).name);
  return found == paths_.end() ? "" : found->second;
}

std::string ParameterValues::text(const ParameterInfo& parameter) const {
  if (parameter.file) return path(parameter.name);
  const double* values = flat_.data() + parameter.offset;
  if (!parameter.choices.empty()) return std::string(parameter.choices[static_cast<std::size_t>(values[0])]);
  if (parameter.components == 1 || (values[0] == values[1] && values[0] == values[2])) return number_text(values[0]);
  return number_text(values[0]) + "," + number_text(values[1]) + "," + number_text(values[2]);
}

}  // namespace lobefit
