// Callisto's float batch for one instruction set each, whatever the machine's best is.
#pragma once

#include "evaluate/float_model.h"

namespace lobefit {

void evaluate_callisto_sse2(std::span<const float> flat, const FloatPairs& pairs, std::size_t begin, std::size_t end,
                            FloatRgb& values);
void evaluate_callisto_avx2(std::span<const float> flat, const FloatPairs& pairs, std::size_t begin, std::size_t end,
                            FloatRgb& values);
void evaluate_callisto_avx512f(std::span<const float> flat, const FloatPairs& pairs, std::size_t begin, std::size_t end,
                               FloatRgb& values);

}  // namespace lobefit
