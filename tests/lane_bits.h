// The float lanes of the random walk, run by code for one instruction set, as bits.
#pragma once

#include <cstdint>
#include <vector>

namespace lane_bits {

/// The library's own, whatever clones the loader picked.
std::vector<std::uint64_t> shipped();
/// The same text compiled for SSE2 alone, without clones.
std::vector<std::uint64_t> sse2();
/// For AVX2 with FMA at hand, which contraction would use; call it where the CPU has both.
std::vector<std::uint64_t> avx2();

}  // namespace lane_bits
