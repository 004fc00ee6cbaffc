// What a model or a reference is, for machines: `lobefit models --json`, and Python.
#pragma once

#include "models/registry.h"
#include "reference/references.h"
#include "reference/table.h"

namespace lobefit {

/// Name, kind, title, doc, source, parameters, properties, and operations counted on the traced text.
Json model_json(const Model& model);
/// Name, doc, source, parameters.
Json reference_json(const Reference& reference);

}  // namespace lobefit
