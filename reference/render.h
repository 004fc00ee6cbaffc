// Tables from references and models.
#pragma once

#include <span>

#include "models/registry.h"
#include "reference/monitor.h"
#include "reference/part_file.h"
#include "reference/references.h"
#include "reference/table.h"

namespace lobefit {

struct RenderOptions {
  SamplingOptions sampling{.samples = 1u << 14};  // per entry
  bool exact = false;
  bool orders = false;  // keep the orders of scattering apart, where the reference has them
  /// One facet set serves all lights of a line: fast, but their errors are correlated, so replicates are kept.
  /// Otherwise every entry has its own facets. An error target doubles the samples of a whole line, or of one entry.
  bool shared_facets = true;
};

/// Which lines are rendered, and where finished ones are kept until all are. Neither changes a bit of them.
struct RenderJob {
  Shards shards;
  PartFile* part = nullptr;  // null: nowhere
};

/// Renders `reference` with `values` over the grid and the parameter axes. The bits depend on the arguments alone, not
/// on the number of threads. Entries whose results are no finite numbers are masked: see Table::failed(). Throws
/// Error(usage) if an axis is no parameter or leaves its range.
Table render(const Reference& reference, const ParameterValues& values, std::vector<Axis> parameter_axes,
             const Grid& grid, const RenderOptions& options, Monitor& monitor, const RenderJob& job = {});

/// The same for a model: exact values.
Table render(const Model& model, const ParameterValues& values, std::vector<Axis> parameter_axes, const Grid& grid,
             Monitor& monitor, const RenderJob& job = {});

}  // namespace lobefit
