// lobefit refit with a recipe of closed forms.
#pragma once

#include "cli/arguments.h"

namespace lobefit {

/// Runs the recipe at `path`; results go to `output`, or out/RECIPE if it is empty.
void refit_approximations(const std::filesystem::path& path, const std::string& output, const Context& context);

}  // namespace lobefit
