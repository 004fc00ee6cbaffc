// UTIA tables (Filip and Vávra 2014), `.bin`: anisotropic BRDFs, 64-bit floats without a header, three planes of
// [theta_i][phi_i][theta_v][phi_v] with steps of 15° from 0 to 75° and of 7.5°.
#pragma once

#include <string>
#include <string_view>

#include "reference/table.h"

namespace lobefit {

struct Utia {
  static constexpr std::size_t thetas = 6, phis = 48, directions = thetas * phis;
  static constexpr std::size_t file_size = 3 * directions * directions * sizeof(double);

  /// Readers disagree on the scale of the numbers, and nothing in the file decides: as they are (the default), or
  /// divided by 140, decoded from sRGB and multiplied by 100 (dj_brdf).
  enum class Scale { raw, srgb };

  /// Throws Error(invalid_input) for another size or a value that is no number. Negative values are masked.
  static Table parse(std::string_view bytes, Scale scale, const std::string& place);
};

}  // namespace lobefit
