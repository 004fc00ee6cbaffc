// Random numbers from counters: a number is a function of its key, never of a shared stream, so that any thread may
// draw it at any time.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace lobefit {

/// Philox4x32-10 (Salmon et al. 2011, Parallel Random Numbers: As Easy as 1, 2, 3).
inline std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53u} * counter[0];
    const std::uint64_t b = std::uint64_t{0xCD9E8D57u} * counter[2];
    counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
               static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key[0] += 0x9E3779B9u;
    key[1] += 0xBB67AE85u;
  }
  return counter;
}

/// The middle of the 2^-32 cell that `bits` names: in (0, 1), never at an end.
inline double unit_interval(std::uint32_t bits) { return (static_cast<double>(bits) + 0.5) * 0x1p-32; }

/// Names one stream of sample points: the numbers of different keys are independent.
struct StreamKey {
  std::uint64_t seed = 1;
  std::uint64_t entry = 0;
  std::uint32_t replicate = 0;
};

enum class Sampler { sobol, philox };

/// Sample points of one stream in the unit square.
class SamplePoints {
 public:
  SamplePoints(Sampler sampler, const StreamKey& key);

  /// Point number `index` < 2^32.
  std::array<double, 2> operator()(std::uint32_t index) const;

  /// Points first, first + 1, …, one array per coordinate: the same numbers, Sobol's ten times as fast.
  void fill(std::uint32_t first, std::span<double> u, std::span<double> v) const;

 private:
  std::array<std::uint32_t, 4> block(std::uint32_t index, std::uint32_t purpose) const;

  Sampler sampler_;
  StreamKey key_;
  std::array<std::uint32_t, 2> scramble_;
};

}  // namespace lobefit
