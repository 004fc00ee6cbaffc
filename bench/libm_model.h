// The baseline of the batch benchmarks: every model's text, scalar and with libm.
#pragma once

#include "evaluate/float_model.h"

namespace lobefit {

using Batch = decltype(FloatModel::evaluate);

/// In the order of float_models().
std::span<const Batch> libm_batches();

}  // namespace lobefit
