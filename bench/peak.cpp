#include "bench/peak.h"

#include <immintrin.h>

namespace lobefit {

namespace {

constexpr int chains = 12;  // more than latency × ports, fewer than the registers of AVX2

[[gnu::target("avx512f"), gnu::noinline]] float multiply_adds_avx512(std::uint64_t count) {
  __m512 sums[chains];
  for (int k = 0; k < chains; ++k) sums[k] = _mm512_set1_ps(0.001f * static_cast<float>(k));
  const __m512 a = _mm512_set1_ps(0.999f), b = _mm512_set1_ps(0.001f);
  for (std::uint64_t i = 0; i < count; ++i) {
#pragma GCC unroll 12
    for (int k = 0; k < chains; ++k) sums[k] = _mm512_fmadd_ps(sums[k], a, b);
  }
  for (int k = 1; k < chains; ++k) sums[0] = _mm512_add_ps(sums[0], sums[k]);
  alignas(64) float out[16];
  _mm512_store_ps(out, sums[0]);
  return out[0];
}

[[gnu::target("avx2,fma"), gnu::noinline]] float multiply_adds_avx2(std::uint64_t count) {
  __m256 sums[chains];
  for (int k = 0; k < chains; ++k) sums[k] = _mm256_set1_ps(0.001f * static_cast<float>(k));
  const __m256 a = _mm256_set1_ps(0.999f), b = _mm256_set1_ps(0.001f);
  for (std::uint64_t i = 0; i < count; ++i) {
#pragma GCC unroll 12
    for (int k = 0; k < chains; ++k) sums[k] = _mm256_fmadd_ps(sums[k], a, b);
  }
  for (int k = 1; k < chains; ++k) sums[0] = _mm256_add_ps(sums[0], sums[k]);
  alignas(32) float out[8];
  _mm256_store_ps(out, sums[0]);
  return out[0];
}

bool wide() { return __builtin_cpu_supports("avx512f"); }

}  // namespace

std::uint64_t dependent_additions(std::uint64_t count) {
  std::uint64_t x = 0;
  for (std::uint64_t i = 0; i < count; i += 16) {
    // Register operands: some cores do additions of constants for free.
    const std::uint64_t step = i | 1;
#pragma GCC unroll 16
    for (int k = 0; k < 16; ++k) asm volatile("add %1, %0" : "+r"(x) : "r"(step));
  }
  return x;
}

float multiply_adds(std::uint64_t count) { return wide() ? multiply_adds_avx512(count) : multiply_adds_avx2(count); }
std::uint64_t operations_per_round() { return chains * 2 * (wide() ? 16 : 8); }
int peak_operations_per_cycle() { return 2 * 2 * (wide() ? 16 : 8); }

}  // namespace lobefit
