// Texts and numbers as a page carries them: escaped; in half precision and base64.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace lobefit {

/// Text as markup: in an element or a quoted attribute.
std::string escaped(std::string_view text);

/// Of any bytes (RFC 4648).
std::string base64(std::string_view bytes);

/// Half floats, little-endian, in base64, of values × 1/scale; not a number stays so.
struct PackedValues {
  double scale;  // a power of two
  std::string data;
};

/// The scale brings the largest magnitude near the top of the format: 11 bits down to 1e-8 of the largest value.
PackedValues pack_values(std::span<const float> values);

}  // namespace lobefit
