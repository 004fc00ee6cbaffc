// Sobol points under a nested uniform (Owen) scramble, done by hashing.
#include "reference/sample_points.h"

namespace lobefit {

namespace {

std::uint32_t reverse_bits(std::uint32_t x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0F0F0F0Fu) | ((x & 0x0F0F0F0Fu) << 4);
  return __builtin_bswap32(x);
}

/// Second Sobol dimension: its generator matrix is Pascal's triangle modulo 2.
std::uint32_t sobol_second(std::uint32_t index) {
  std::uint32_t column = 0x80000000u, point = 0;
  for (; index != 0; index >>= 1) {
    if (index & 1u) point ^= column;
    column ^= column >> 1;
  }
  return point;
}

/// A permutation of [0, 2^32) in which each bit is flipped by a hash of the bits above it. On reversed bits every
/// step must only carry upwards: additions and products by even numbers plus one (Laine, Karras 2011; the constants
/// are Vegdahl's 2021).
std::uint32_t nested_uniform_scramble(std::uint32_t point, std::uint32_t seed) {
  std::uint32_t x = reverse_bits(point);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reverse_bits(x);
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
  return {unit_interval(nested_uniform_scramble(reverse_bits(index), scramble_[0])),
          unit_interval(nested_uniform_scramble(sobol_second(index), scramble_[1]))};
}

}  // namespace lobefit
