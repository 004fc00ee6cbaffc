// One page of every constant that recipes refit.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "reference/json_reader.h"

namespace lobefit {

struct RecipeOutcome {
  std::string recipe;
  std::filesystem::path folder;  // relative to the page
  Json result;                   // result.json
};

/// Published and refitted constants with their intervals, the domain and metric under which the published ones are the
/// best where one was found, and the errors of both. `command` made them.
std::string constants_page(const std::vector<RecipeOutcome>& outcomes, const std::string& command);

}  // namespace lobefit
