#include "evaluate/storage_code.h"

#include <algorithm>
#include <cmath>

#include "reference/srgb.h"

namespace lobefit {

namespace {

/// To [-1, 1]².
std::array<double, 2> to_octahedron(const Direction& n) {
  const double sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  const double x = n.x / sum, y = n.y / sum;
  if (n.z >= 0.0) return {x, y};
  return {std::copysign(1.0 - std::abs(y), x), std::copysign(1.0 - std::abs(x), y)};
}

Direction from_octahedron(double x, double y) {
  const double z = 1.0 - std::abs(x) - std::abs(y);
  if (z >= 0.0) return normalize(Direction{x, y, z});
  return normalize(Direction{std::copysign(1.0 - std::abs(y), x), std::copysign(1.0 - std::abs(x), y), z});
}

}  // namespace

std::uint32_t StorageCode::last() const {
  const std::uint32_t all = ~std::uint32_t{0} >> (32 - bits_);
  return field_->encoding == StorageEncoding::centred ? all - 1 : all;
}

double StorageCode::value(std::uint32_t code) const {
  const double share = static_cast<double>(code) / last();
  switch (field_->encoding) {
    case StorageEncoding::index: return code;
    case StorageEncoding::linear:
    case StorageEncoding::centred: return lerp(field_->lower, field_->upper, share);
    case StorageEncoding::square: return field_->upper * share * share;
    case StorageEncoding::srgb: return srgb_decode(share);
    case StorageEncoding::ratio:
      return code == 0 ? 0.0 : field_->lower * std::pow(field_->upper / field_->lower, (code - 1.0) / (last() - 1.0));
  }
  return 0.0;
}

std::uint32_t StorageCode::below(double number) const {
  const double range = field_->upper - field_->lower;
  double share = 0.0;
  switch (field_->encoding) {
    case StorageEncoding::index: share = number / last(); break;
    case StorageEncoding::linear:
    case StorageEncoding::centred: share = (number - field_->lower) / range; break;
    case StorageEncoding::square: share = std::sqrt(std::max(number, 0.0) / field_->upper); break;
    case StorageEncoding::srgb: share = srgb_encode(std::max(number, 0.0)); break;
    case StorageEncoding::ratio:
      if (number <= 0.0) return 0;
      if (number <= field_->lower) return 1;
      share =
          (1.0 + (last() - 1.0) * std::log(number / field_->lower) / std::log(field_->upper / field_->lower)) / last();
  }
  auto code = static_cast<std::uint32_t>(std::clamp(share, 0.0, 1.0) * last());
  // The inverse is off by roundings at most.
  while (code > 0 && value(code) > number) --code;
  while (code < last() && value(code + 1) <= number) ++code;
  return code;
}

std::uint32_t StorageCode::code(double number, double threshold) const {
  const std::uint32_t lower = below(number);
  if (lower == last()) return lower;
  const double gap = number - value(lower);
  return gap > threshold * (value(lower + 1) - value(lower)) ? lower + 1 : lower;
}

double StorageCode::step(double number) const {
  const std::uint32_t lower = std::min(below(number), last() - 1);
  return value(lower + 1) - value(lower);
}

Direction decoded_direction(const StorageField& field, std::array<std::uint32_t, 2> codes) {
  return from_octahedron(StorageCode(field, 0).value(codes[0]), StorageCode(field, 1).value(codes[1]));
}

std::array<std::uint32_t, 2> direction_codes(const StorageField& field, const Direction& n) {
  const std::array<double, 2> place = to_octahedron(n);
  const StorageCode first(field, 0), second(field, 1);
  std::array<std::uint32_t, 2> best{};
  double nearest = 5.0;
  for (const double x : {0.0, 1.0}) {
    for (const double y : {0.0, 1.0}) {
      // A threshold of 1 gives the lower neighbour, 0 the upper one.
      const std::array codes{first.code(place[0], x == 0.0 ? 1.0 : 0.0), second.code(place[1], y == 0.0 ? 1.0 : 0.0)};
      const Direction gap = decoded_direction(field, codes) - n;
      if (dot(gap, gap) < nearest) nearest = dot(gap, gap), best = codes;
    }
  }
  return best;
}

}  // namespace lobefit
