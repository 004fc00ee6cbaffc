// What a parameter is, and how a parameter struct meets flat arrays of numbers.
//
// A model (or a reference) declares its parameters once, in describe(p, visit): one visit per member with a
// ParameterInfo. Flags, JSON, Ceres bounds, shader structs, documentation and checks all derive from that line.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "models/error.h"
#include "models/scalar.h"

namespace lobefit {

/// Who a parameter is for (Callisto, slide 98).
enum class Tier { base, advanced, full };

inline std::string_view tier_name(Tier tier) {
  constexpr std::array<std::string_view, 3> names{"base", "advanced", "full"};
  return names[static_cast<std::size_t>(tier)];
}

struct ParameterInfo {
  std::string_view name;
  std::string_view symbol = "";
  std::string_view unit = "";  // "" = dimensionless
  double lower = 0.0, upper = 1.0;
  double initial = 0.0;
  Tier tier = Tier::base;
  std::string_view doc = "";
  std::span<const std::string_view> choices = {};  // named values 0, 1, …, if not a number
  bool perceptual_roughness = false;               // alpha is its square: tables over alpha set it
  bool file = false;                               // a file's path, not a number; takes no slot
  int components = 1;                              // 3 for RGB, 0 for a file; set by the visit
  int offset = 0;                                  // first slot in the flat array; set by the visit
};

template <class T>
inline constexpr int component_count = is_vector<T> ? 3 : 1;

/// The flat layout of D's parameters, D being a model or a reference.
template <class D>
std::vector<ParameterInfo> describe_parameters() {
  std::vector<ParameterInfo> list;
  typename D::template Parameters<double> p{};
  int offset = 0;
  D::describe(p, [&](auto& member, ParameterInfo info) {
    info.components = component_count<std::remove_cvref_t<decltype(member)>>;
    info.offset = offset;
    offset += info.components;
    list.push_back(info);
  });
  return list;
}

/// A parameter struct from its flat array: RGB takes three slots.
template <class D, class T, class Slot>
typename D::template Parameters<T> unflatten(std::span<const Slot> flat) {
  typename D::template Parameters<T> p{};
  std::size_t slot = 0;
  D::describe(p, [&](auto& member, const ParameterInfo&) {
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      member = {T(flat[slot]), T(flat[slot + 1]), T(flat[slot + 2])};
      slot += 3;
    } else {
      member = T(flat[slot++]);
    }
  });
  return p;
}

/// Name in `names` with the smallest edit distance to `name`; "" if `names` is empty.
std::string nearest_name(std::string_view name, std::span<const std::string> names);

/// Values of a described parameter list, by name and flat.
class ParameterValues {
 public:
  ParameterValues() = default;
  explicit ParameterValues(std::vector<ParameterInfo> list, std::string owner);

  const std::vector<ParameterInfo>& list() const { return list_; }
  const std::string& owner() const { return owner_; }
  std::span<const double> flat() const { return flat_; }
  std::span<double> flat() { return flat_; }

  bool has(std::string_view name) const;
  /// Throws Error(usage) with the nearest name.
  const ParameterInfo& info(std::string_view name) const;
  /// Sets one number (RGB: all three channels). Throws Error(usage) outside the range, or if not a number.
  void set(std::string_view name, double value) { set(name, std::array{value}); }
  void set(std::string_view name, std::span<const double> components);
  /// From text: a number, `r,g,b`, or one of the choices.
  void set_text(std::string_view name, std::string_view text);
  /// First component.
  double get(std::string_view name) const { return flat_[static_cast<std::size_t>(info(name).offset)]; }
  /// The slots of one parameter.
  std::span<const double> components(const ParameterInfo& info) const {
    return std::span(flat_).subspan(static_cast<std::size_t>(info.offset), static_cast<std::size_t>(info.components));
  }
  std::string_view choice(std::string_view name) const;
  /// A file's path, "" if none was given.
  std::string path(std::string_view name) const;
  /// One value as people write it: `0.5`, `0.1,0.2,0.3` or a choice.
  std::string text(const ParameterInfo& info) const;

 private:
  std::vector<ParameterInfo> list_;
  std::vector<double> flat_;
  std::map<std::string, std::string, std::less<>> paths_;
  std::string owner_;
};

/// The number that all of `text` spells; throws Error(usage) for anything else, NaN and infinities included.
double parse_number(std::string_view text, std::string_view what);
/// Numbers separated by commas.
std::vector<double> parse_numbers(std::string_view text, std::string_view what);
/// Shortest decimal that reads back as the same double.
std::string number_text(double value);

}  // namespace lobefit
