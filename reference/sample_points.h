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

/// Sample points of one stream: for every index a sequence of pairs of numbers, pair 0, 1, 2, … Sobol: every pair is a
/// scrambled two-dimensional Sobol set in an order of its own (padding; Kollig, Keller 2002), from pair 16 on Philox.
class SamplePoints {
 public:
  SamplePoints(Sampler sampler, const StreamKey& key);

  /// Point number `index` < 2^32: its pair 0.
  std::array<double, 2> operator()(std::uint32_t index) const { return pair(index, 0); }
  /// Pair number `number` < 2^15.
  std::array<double, 2> pair(std::uint32_t index, std::uint32_t number) const;

  /// Pairs 0 of first, first + 1, …, one array per coordinate: the same numbers, Sobol's ten times as fast.
  void fill(std::uint32_t first, std::span<double> u, std::span<double> v) const;
  /// The same in float, as the middles of cells 2^-23 wide.
  void fill(std::uint32_t first, std::span<float> u, std::span<float> v) const;
  /// Pairs `number` of some indices, in float: the middles of cells 2^-23 wide. Arrays may be longer than `indices`.
  void fill(std::uint32_t number, std::span<const std::uint32_t> indices, std::span<float> u, std::span<float> v) const;

 private:
  static constexpr std::uint32_t sobol_pairs = 16;
  struct Scramble {
    std::uint32_t u, v, order;
  };

  std::uint32_t shared_word(std::uint32_t number, std::uint32_t purpose) const;
  std::array<std::uint32_t, 4> block(std::uint32_t index, std::uint32_t number, std::uint32_t purpose) const;

  Sampler sampler_;
  StreamKey key_;
  std::array<Scramble, sobol_pairs> scrambles_;
};

/// The numbers of one path, one after the other.
class PathNumbers {
 public:
  PathNumbers(const SamplePoints& points, std::uint32_t index) : points_(&points), index_(index) {}

  std::array<double, 2> next_pair() {
    has_spare_ = false;
    return points_->pair(index_, number_++);
  }
  double next() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const std::array<double, 2> pair = next_pair();
    spare_ = pair[1];
    has_spare_ = true;
    return pair[0];
  }

 private:
  const SamplePoints* points_;
  std::uint32_t index_, number_ = 0;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace lobefit
