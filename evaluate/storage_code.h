// What the codes of a field stand for (models/substrate/storage.h): numbers, and directions on the octahedron.
#pragma once

#include <array>
#include <cstdint>

#include "models/substrate/storage.h"

namespace lobefit {

/// The codes of one component of a field: 0, …, last_code().
class StorageCode {
 public:
  StorageCode(const StorageField& field, int component)
      : field_(&field), bits_(field.bits[static_cast<std::size_t>(component)]) {}

  int bits() const { return bits_; }
  std::uint32_t last() const;
  double value(std::uint32_t code) const;
  /// The upper of the two neighbours where the number's place between them is above the threshold, so that .5 is the
  /// nearest. Out of range the nearest end; a positive number below the first ratio is that one, as 0 has a meaning.
  std::uint32_t code(double number, double threshold = 0.5) const;
  /// From the value of the last code that is not above the number to that of the next.
  double step(double number) const;

 private:
  std::uint32_t below(double number) const;
  const StorageField* field_;
  int bits_;
};

/// The unit direction of a field of two components, on the octahedral map (Meyer et al. 2010).
Direction decoded_direction(const StorageField& field, std::array<std::uint32_t, 2> codes);
/// Of the four codes around a unit direction the one nearest to it (Cigolle et al. 2014).
std::array<std::uint32_t, 2> direction_codes(const StorageField& field, const Direction& n);

}  // namespace lobefit
