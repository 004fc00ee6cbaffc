// What counted operations cost a GPU's lane.
#pragma once

#include "evaluate/expression.h"

namespace lobefit {

/// Cycles in which a full-rate unit does one operation. Square roots, exponentials and logarithms run at a quarter of
/// that rate, and a division is a reciprocal, at a quarter too, and a multiplication (AMD, RDNA ISA: transcendental
/// instructions; NVIDIA's rate is between a quarter and an eighth). An upper estimate: nothing is fused, and signs,
/// abs and saturate, which are free modifiers of most instructions, count in full. Table reads are no arithmetic.
inline int alu_cycles(const OperationCount& count) {
  constexpr int quarter_rate = 4;
  return count.add_multiply + count.compare_select + (quarter_rate + 1) * count.divide +
         quarter_rate * (count.square_root + count.transcendental);
}

}  // namespace lobefit
