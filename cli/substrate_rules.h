// Where the shipped rules for collapsing Substrate trees are, and the recipe that refits them.
#pragma once

#include <filesystem>

#include "cli/arguments.h"
#include "models/substrate/blend.h"

namespace lobefit {

/// The program's data: LOBEFIT_DATA, or beside the sources.
std::filesystem::path data_folder();
/// data/substrate_rules.json.
std::filesystem::path shipped_rules();

/// The rules as shader code, with a head that says where they came from.
std::string rules_shader(const std::string& language, const FittedBlend::Constants<double>& constants,
                         const std::string& command);

/// lobefit refit substrate-rules.
void refit_substrate_rules(const std::filesystem::path& recipe, const std::string& output, bool resume,
                           const Context& context);

}  // namespace lobefit
