// What storing a model's parameters in few bits costs, as error of the BRDF: all of them together, and each alone.
//
//   const StorageChoice choice = choose_codes(proxima.parameters, {"fp16", "albedo=rgb776"});
//   const ParameterStorageError error = parameter_storage_error(proxima, parameter_sets, choice);
//   error.alone.front().name      the one that hurts most
//
// This is for any model. What engines really store, with its own layouts and losses, is in gbuffer_error.h and
// substrate_storage_error.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evaluate/parameter_code.h"
#include "models/registry.h"
#include "reference/metric.h"

namespace lobefit {

/// For each parameter of a model its code; null: kept as it is.
using StorageChoice = std::vector<const ParameterCode*>;

/// From "CODE", for all parameters that are numbers, and "NAME=CODE", which outranks it. Named choices and files are
/// part of a shader's text and are not stored. Throws Error(usage).
StorageChoice choose_codes(const std::vector<ParameterInfo>& parameters, const std::vector<std::string>& texts);

struct StoredParameterError {
  std::string name;
  const ParameterCode* code;
  int bits;
  double largest_error;  // of a component, in the parameter's own terms
  QuantityErrors rms;    // with this parameter alone as it is read back
  int overflows;         // parameter sets in which a component is beyond binary16, and is taken as its largest number
};

struct ParameterStorageError {
  std::size_t parameter_sets, pairs;        // pairs of directions in each set
  QuantityErrors together;                  // all parameters as they are read back, rms of every quantity
  std::vector<StoredParameterError> alone;  // from the worst in log(1 + f c) down
  std::uint64_t non_finite;                 // values that are no finite numbers; left out of the sums
};

/// Means over the parameter sets, channels and directions: the grid that measurements are fitted on, weighted by the
/// sines of both polar angles. Models that are anisotropic take the default grid at four turns, 45° apart; those that
/// are defined on the whole sphere take that. c is |cos theta_i|, of hair 1.
ParameterStorageError parameter_storage_error(const Model& model, const std::vector<ParameterValues>& parameter_sets,
                                              const StorageChoice& choice);

}  // namespace lobefit
