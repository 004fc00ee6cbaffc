// Closed forms as a GPU runs them: shader functions with their constants baked in, and float.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "evaluate/expression.h"

namespace lobefit {

/// `float Lobefit_NAME(float argument, …)` with these constants. Throws Error(usage) for an unknown form or language.
std::string form_shader(std::string_view form, std::string_view language, std::span<const double> constants,
                        std::span<const std::string> provenance);
/// Of form_shader()'s text.
OperationCount form_operations(std::string_view form, std::span<const double> constants);
/// In float, all of it.
float form_in_float(std::string_view form, std::span<const double> constants, std::span<const double> arguments);

}  // namespace lobefit
