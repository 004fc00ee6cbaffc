// lobefit export --gbuffer: what a fit becomes in the port's GBuffer.
#pragma once

#include <string>
#include <vector>

#include "cli/arguments.h"
#include "evaluate/gbuffer.h"

namespace lobefit {

struct GBufferSettings {
  std::string name;                   // a fit or a model
  std::vector<std::string> settings;  // NAME=VALUE; of a table's axes they choose the row
  std::string table, material, output;
  GBufferOptions options;
};

void export_gbuffer(const GBufferSettings& settings, const Context& context);

}  // namespace lobefit
