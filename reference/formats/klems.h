// LBNL/Klems XML (WINDOW, genBSDF): a matrix between the patches of two hemispheres. Of its parts the reflection at the
// front is read, for visible light where the file has several bands; transmission is no BRDF of one side.
#pragma once

#include <string>
#include <string_view>

#include "reference/table.h"

namespace lobefit {

struct Klems {
  static bool recognise(std::string_view text);
  /// A list of patch centres × patch centres. Throws Error(invalid_input) with the byte.
  static Table parse(std::string_view text, const std::string& place);
};

}  // namespace lobefit
