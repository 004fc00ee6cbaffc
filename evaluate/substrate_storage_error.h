// What storing a Substrate material in few bits costs: in each field's own terms, and as error of the BRDF.
#pragma once

#include <string>
#include <vector>

#include "evaluate/substrate_storage.h"
#include "reference/metric.h"

namespace lobefit {

/// How far one component of a field can be from what was stored, over numbers uniform in the field's range; of fields
/// with even ratios relative to the number, over numbers uniform in its logarithm, smaller than the first left out.
struct QuantisationError {
  double worst_step;    // the nearest code is off by half of it at most, a dithered one by less than it
  double rms_nearest;   // of the rounding error
  double rms_dithered;  // the same over all thresholds: its mean is 0
  bool relative;
};
/// For fields of numbers.
QuantisationError quantisation_error(const StorageField& field, int component);

/// Reflected radiance of all closures per unit irradiance on the frame's surface, 1/sr. wi and wo in that frame; a
/// closure whose own normal turns away from either adds nothing.
Rgb closures_brdf(std::span<const StoredClosure> closures, const TangentBasis& frame, const Direction& wi,
                  const Direction& wo);

struct StoredFieldError {
  std::size_t closure;
  std::string field;  // "tangent_basis" for its direction
  double rms;         // of log(1 + f c), with this field alone as it was read back
};

struct SubstrateStorageError {
  QuantityErrors total;                 // read back against given, rms of every quantity
  std::vector<StoredFieldError> alone;  // from the worst down
};

/// `read` as unpack_material() gives it for `given`. `table`: the directions, about the first closure's normal, without
/// parameter axes and with three channels; azimuths of materials with anisotropic or tilted closures are taken from
/// four turns of it about the normal, 45° apart. `weights`: of its entries, see entry_weights(). Throws Error(usage) if
/// the numbers of closures differ.
SubstrateStorageError substrate_storage_error(std::span<const StoredClosure> given, std::span<const StoredClosure> read,
                                              const Table& table, const std::vector<double>& weights);

}  // namespace lobefit
