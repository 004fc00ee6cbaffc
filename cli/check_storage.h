// lobefit check --storage: what parameters in few bits cost.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/arguments.h"

namespace lobefit {

/// A model and the parameter sets that it is checked with.
struct CheckedModel {
  const Model* model;
  std::vector<ParameterValues> parameter_sets;
};

struct StorageSettings {
  std::vector<std::string> codes;   // CODE or NAME=CODE
  std::optional<double> tolerance;  // of the rms of log(1 + f c), of all parameters together
};

/// The codes that there are, for --help.
std::string storage_help();
/// Prints the errors of every model. Throws Error(check_failed) beyond the tolerance, or if a value is not finite.
void check_storage(const std::vector<CheckedModel>& models, const StorageSettings& settings, const Context& context);

}  // namespace lobefit
