// Sobol points under a nested uniform (Owen) scramble, done by hashing.
#include "reference/sample_points.h"

#include "models/instruction_sets.h"
#include "models/scalar.h"

namespace lobefit {

namespace {

// Everything here is written for loops that vectorise: shifts, masks and products only.

LOBEFIT_TEXT std::uint32_t reverse_bits(std::uint32_t x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0F0F0F0Fu) | ((x & 0x0F0F0F0Fu) << 4);
  x = ((x >> 8) & 0x00FF00FFu) | ((x & 0x00FF00FFu) << 8);
  return (x >> 16) | (x << 16);
}

/// Second Sobol dimension with its bits reversed (the first one's is the index itself). Its generator matrix is
/// Pascal's triangle modulo 2, which is a Kronecker power: one step per bit of the bit's number.
LOBEFIT_TEXT std::uint32_t sobol_second_reversed(std::uint32_t index) {
  std::uint32_t x = index;
  x ^= (x >> 1) & 0x55555555u;
  x ^= (x >> 2) & 0x33333333u;
  x ^= (x >> 4) & 0x0F0F0F0Fu;
  x ^= (x >> 8) & 0x00FF00FFu;
  x ^= x >> 16;
  return x;
}

/// A permutation of [0, 2^32) in which each bit is flipped by a hash of the bits above it; takes the point with its
/// bits reversed. On reversed bits every step must only carry upwards: additions and products by even numbers plus
/// one (Laine, Karras 2011; the constants are Vegdahl's 2021).
LOBEFIT_TEXT std::uint32_t nested_uniform_scramble(std::uint32_t reversed, std::uint32_t seed) {
  std::uint32_t x = reversed;
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reverse_bits(x);
}

/// unit_interval() by way of a signed number: no instruction set before AVX-512 converts unsigned ones.
LOBEFIT_TEXT double unit_interval_signed(std::uint32_t bits) {
  return (static_cast<double>(static_cast<std::int32_t>(bits ^ 0x80000000u)) + (0x1p31 + 0.5)) * 0x1p-32;
}

LOBEFIT_CLONES [[gnu::noinline]] void fill_sobol(std::uint32_t first, std::uint32_t scramble_u,
                                                 std::uint32_t scramble_v, std::size_t n, double* __restrict u,
                                                 double* __restrict v) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t index = first + static_cast<std::uint32_t>(i);
    u[i] = unit_interval_signed(nested_uniform_scramble(index, scramble_u));
    v[i] = unit_interval_signed(nested_uniform_scramble(sobol_second_reversed(index), scramble_v));
  }
}

}  // namespace

SamplePoints::SamplePoints(Sampler sampler, const StreamKey& key) : sampler_(sampler), key_(key) {
  const auto bits = block(0, 1);
  scramble_ = {bits[0], bits[1]};
}

std::array<std::uint32_t, 4> SamplePoints::block(std::uint32_t index, std::uint32_t purpose) const {
  // 64 bits of seed are the key; the entry's upper half shares a word with the purpose, which is one bit.
  return philox({index, key_.replicate, static_cast<std::uint32_t>(key_.entry),
                 static_cast<std::uint32_t>(key_.entry >> 32 << 1) | purpose},
                {static_cast<std::uint32_t>(key_.seed), static_cast<std::uint32_t>(key_.seed >> 32)});
}

std::array<double, 2> SamplePoints::operator()(std::uint32_t index) const {
  if (sampler_ == Sampler::philox) {
    const auto bits = block(index, 0);
    return {unit_interval(bits[0]), unit_interval(bits[1])};
  }
  return {unit_interval(nested_uniform_scramble(index, scramble_[0])),
          unit_interval(nested_uniform_scramble(sobol_second_reversed(index), scramble_[1]))};
}

void SamplePoints::fill(std::uint32_t first, std::span<double> u, std::span<double> v) const {
  if (sampler_ == Sampler::sobol) return fill_sobol(first, scramble_[0], scramble_[1], u.size(), u.data(), v.data());
  for (std::size_t i = 0; i < u.size(); ++i) {
    const std::array<double, 2> point = (*this)(first + static_cast<std::uint32_t>(i));
    u[i] = point[0], v[i] = point[1];
  }
}

}  // namespace lobefit
