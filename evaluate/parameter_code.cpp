#include "evaluate/parameter_code.h"

#include <Imath/half.h>

#include <algorithm>
#include <cmath>

#include "evaluate/storage_code.h"

namespace lobefit {

namespace {

using enum StorageEncoding;

constexpr std::array codes{
    ParameterCode{"fp16", {16, 16, 16}, std::nullopt, "IEEE 754 binary16, to the nearest"},
    ParameterCode{"unorm8", {8, 8, 8}, linear, "even steps over the range"},
    ParameterCode{"srgb8", {8, 8, 8}, srgb, "sRGB's curve over the range"},
    ParameterCode{"rgb776", {7, 7, 6}, linear, "even steps over the range, blue the coarsest"},
    ParameterCode{"srgb776", {7, 7, 6}, srgb, "sRGB's curve over the range, as Substrate's albedo"},
    ParameterCode{"square776", {7, 7, 6}, square, "squares of even steps over the range, as Substrate's F0"},
    ParameterCode{"unorm16", {16, 16, 16}, linear, "even steps over the range"},
};

}  // namespace

double ParameterCode::decoded(double value, const ParameterInfo& info, int component) const {
  if (!encoding) {
    const double finite = std::clamp(value, -largest_half, largest_half);
    return static_cast<double>(static_cast<float>(Imath::half(static_cast<float>(finite))));
  }
  // Curves begin at 0, so that a range is brought to [0, 1].
  const bool even = *encoding == linear;
  const StorageField field{.name = name,
                           .part = StoragePart::closure_data,
                           .bits = bits,
                           .encoding = *encoding,
                           .lower = even ? info.lower : 0.0,
                           .upper = even ? info.upper : 1.0,
                           .feature = nullptr,
                           .purpose = ""};
  const StorageCode code(field, component);
  if (even) return code.value(code.code(value));
  const double range = info.upper - info.lower;
  return info.lower + range * code.value(code.code((value - info.lower) / range));
}

std::span<const ParameterCode> parameter_codes() { return codes; }

const ParameterCode& find_parameter_code(std::string_view name) {
  const auto found = std::ranges::find(codes, name, &ParameterCode::name);
  if (found != codes.end()) return *found;
  std::string choices;
  for (const ParameterCode& code : codes) choices += (choices.empty() ? "" : ", ") + std::string(code.name);
  throw Error(ExitCode::usage, "unknown code '" + std::string(name) + "'", "--storage", "choose one of " + choices);
}

}  // namespace lobefit
