// What the port's formula and its GBuffer cost, as error.
#pragma once

#include <optional>
#include <vector>

#include "evaluate/gbuffer_material.h"
#include "reference/metric.h"

namespace lobefit {

/// rms of every quantity, of three stages of one material.
struct GBufferStages {
  QuantityErrors fit;     // the material as it was fitted
  QuantityErrors port;    // the port's formula, nothing stored yet
  QuantityErrors packed;  // the same with what the bytes hold
};

struct GBufferError {
  std::optional<GBufferStages> against_table;
  QuantityErrors port_from_fit, packed_from_port, packed_from_fit;
  /// For each of GBufferMaterial::parameters, the rms of log(1 + f c) between the port and the port with this parameter
  /// alone as its bytes hold it; 0 where it has no field.
  std::vector<double> alone;
};

/// `weights`: of the table's entries, see entry_weights(). A table that is `directions_only` has no values to be held
/// against. The table must have one parameter row.
GBufferError gbuffer_error(const ParameterValues& fitted, const GBufferMaterial& material, const Table& table,
                           const std::vector<double>& weights, bool directions_only);

/// Without values, over the grid that measurements are fitted on.
Table gbuffer_directions();

}  // namespace lobefit
