// Sobol points under a nested uniform (Owen) scramble, done by hashing.
#include "reference/sample_points.h"

#include <algorithm>

#include "models/instruction_sets.h"
#include "models/scalar.h"

namespace lobefit {

namespace {

// Everything here is written for loops that vectorise: shifts, masks and products only.

LOBEFIT_TEXT std::uint32_t reverse_bits(std::uint32_t x) {
  // Bytes are not exchanged in one go: GCC would see a byte swap there, and plain AVX-512 has none for its full width.
  x = ((x >> 8) & 0x00FF00FFu) | ((x & 0x00FF00FFu) << 8);
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0F0F0F0Fu) | ((x & 0x0F0F0F0Fu) << 4);
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

/// As unit_interval(), in the 24 bits of a float: never 0 or 1.
LOBEFIT_TEXT float float_unit_interval(std::uint32_t bits) {
  return (static_cast<float>(static_cast<std::int32_t>(bits >> 9)) + 0.5f) * 0x1p-23f;
}

LOBEFIT_CLONES [[gnu::noinline]] void gather_sobol(const std::uint32_t* __restrict indices, std::uint32_t order,
                                                   std::uint32_t scramble_u, std::uint32_t scramble_v, std::size_t n,
                                                   float* __restrict u, float* __restrict v) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t at = nested_uniform_scramble(reverse_bits(indices[i]), order);
    u[i] = float_unit_interval(nested_uniform_scramble(at, scramble_u));
    v[i] = float_unit_interval(nested_uniform_scramble(sobol_second_reversed(at), scramble_v));
  }
}

LOBEFIT_CLONES [[gnu::noinline]] void gather_philox(const std::uint32_t* __restrict indices, std::uint32_t replicate,
                                                    std::uint32_t entry, std::uint32_t shared, std::uint32_t key_low,
                                                    std::uint32_t key_high, std::size_t n, float* __restrict u,
                                                    float* __restrict v) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    std::uint32_t c0 = indices[i], c1 = replicate, c2 = entry, c3 = shared, k0 = key_low, k1 = key_high;
#pragma GCC unroll 10
    for (int round = 0; round < 10; ++round) {
      const std::uint64_t a = std::uint64_t{0xD2511F53u} * c0;
      const std::uint64_t b = std::uint64_t{0xCD9E8D57u} * c2;
      c0 = static_cast<std::uint32_t>(b >> 32) ^ c1 ^ k0;
      c2 = static_cast<std::uint32_t>(a >> 32) ^ c3 ^ k1;
      c1 = static_cast<std::uint32_t>(b);
      c3 = static_cast<std::uint32_t>(a);
      k0 += 0x9E3779B9u;
      k1 += 0xBB67AE85u;
    }
    u[i] = float_unit_interval(c0);
    v[i] = float_unit_interval(c1);
  }
}

LOBEFIT_CLONES [[gnu::noinline]] void fill_sobol_float(std::uint32_t first, std::uint32_t scramble_u,
                                                       std::uint32_t scramble_v, std::size_t n, float* __restrict u,
                                                       float* __restrict v) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t index = first + static_cast<std::uint32_t>(i);
    u[i] = float_unit_interval(nested_uniform_scramble(index, scramble_u));
    v[i] = float_unit_interval(nested_uniform_scramble(sobol_second_reversed(index), scramble_v));
  }
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
  for (std::uint32_t number = 0; number < sobol_pairs; ++number) {
    const auto bits = block(0, number, 1);
    // Pair 0 keeps the order of the indices: fill() writes it out in one sweep.
    scrambles_[number] = {bits[0], bits[1], number == 0 ? 0u : bits[2]};
  }
}

// 64 bits of seed are the key; the entry's upper half (16 bits) shares a word with the pair's number (15 bits) and the
// purpose (1 bit).
std::uint32_t SamplePoints::shared_word(std::uint32_t number, std::uint32_t purpose) const {
  return number << 17 | (static_cast<std::uint32_t>(key_.entry >> 32) & 0xffffu) << 1 | purpose;
}

std::array<std::uint32_t, 4> SamplePoints::block(std::uint32_t index, std::uint32_t number,
                                                 std::uint32_t purpose) const {
  return philox({index, key_.replicate, static_cast<std::uint32_t>(key_.entry), shared_word(number, purpose)},
                {static_cast<std::uint32_t>(key_.seed), static_cast<std::uint32_t>(key_.seed >> 32)});
}

std::array<double, 2> SamplePoints::pair(std::uint32_t index, std::uint32_t number) const {
  if (sampler_ == Sampler::philox || number >= sobol_pairs) {
    const auto bits = block(index, number, 0);
    return {unit_interval(bits[0]), unit_interval(bits[1])};
  }
  const Scramble& scramble = scrambles_[number];
  // A nested scramble of the index permutes every aligned block of 2^k indices within itself: prefixes stay nets.
  const std::uint32_t at = number == 0 ? index : nested_uniform_scramble(reverse_bits(index), scramble.order);
  return {unit_interval(nested_uniform_scramble(at, scramble.u)),
          unit_interval(nested_uniform_scramble(sobol_second_reversed(at), scramble.v))};
}

void SamplePoints::fill(std::uint32_t first, std::span<double> u, std::span<double> v) const {
  if (sampler_ == Sampler::sobol)
    return fill_sobol(first, scrambles_[0].u, scrambles_[0].v, u.size(), u.data(), v.data());
  for (std::size_t i = 0; i < u.size(); ++i) {
    const std::array<double, 2> point = (*this)(first + static_cast<std::uint32_t>(i));
    u[i] = point[0], v[i] = point[1];
  }
}

void SamplePoints::fill(std::uint32_t first, std::span<float> u, std::span<float> v) const {
  if (sampler_ == Sampler::sobol) {
    return fill_sobol_float(first, scrambles_[0].u, scrambles_[0].v, u.size(), u.data(), v.data());
  }
  std::array<std::uint32_t, 256> indices;
  for (std::size_t done = 0; done < u.size(); done += indices.size()) {
    const std::size_t count = std::min(indices.size(), u.size() - done);
    for (std::size_t i = 0; i < count; ++i) indices[i] = first + static_cast<std::uint32_t>(done + i);
    fill(0, std::span<const std::uint32_t>(indices).first(count), u.subspan(done), v.subspan(done));
  }
}

void SamplePoints::fill(std::uint32_t number, std::span<const std::uint32_t> indices, std::span<float> u,
                        std::span<float> v) const {
  if (sampler_ == Sampler::sobol && number < sobol_pairs && number > 0) {
    const Scramble& scramble = scrambles_[number];
    gather_sobol(indices.data(), scramble.order, scramble.u, scramble.v, indices.size(), u.data(), v.data());
  } else if (sampler_ == Sampler::philox || number >= sobol_pairs) {
    gather_philox(indices.data(), key_.replicate, static_cast<std::uint32_t>(key_.entry), shared_word(number, 0),
                  static_cast<std::uint32_t>(key_.seed), static_cast<std::uint32_t>(key_.seed >> 32), indices.size(),
                  u.data(), v.data());
  } else {
    for (std::size_t i = 0; i < indices.size(); ++i) fill(indices[i], u.subspan(i, 1), v.subspan(i, 1));
  }
}

}  // namespace lobefit
