// The numbers behind every Monte Carlo estimate: published answers of the generator, the net property that makes Sobol
// points converge, and the independence and uniformity that make standard errors from replicates honest.
//
// Statistical tests have fixed seeds. Their bounds are met by all but one in a million choices of seeds per statistic.
#include "reference/sample_points.h"

#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "reference/estimate.h"

namespace lobefit {
namespace {

constexpr double false_alarm = 1e-6;

constexpr std::array samplers{Sampler::sobol, Sampler::philox};

std::string name(Sampler sampler) { return sampler == Sampler::sobol ? "sobol" : "philox"; }

/// Value that a chi-squared variable exceeds with probability `tail`.
double chi_squared_bound(double degrees, double tail) {
  return boost::math::quantile(boost::math::complement(boost::math::chi_squared(degrees), tail));
}
/// The same for |z| of a standard normal.
double normal_bound(double tail) {
  return boost::math::quantile(boost::math::complement(boost::math::normal(), 0.5 * tail));
}

/// Pearson's statistic of counts that are equally likely.
double chi_squared(const std::vector<int>& counts) {
  double total = 0.0, sum = 0.0;
  for (const int count : counts) total += count;
  const double expected = total / static_cast<double>(counts.size());
  for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

/// Streams in which one part of the key counts up while the others stand still.
struct KeyFamily {
  std::string name;
  StreamKey (*key)(std::uint32_t k);
};

const std::vector<KeyFamily>& key_families() {
  static const std::vector<KeyFamily> all{{"seed",
                                           [](std::uint32_t k) {
                                             return StreamKey{k, 17, 3};
                                           }},
                                          {"upper half of the seed",
                                           [](std::uint32_t k) {
                                             return StreamKey{(std::uint64_t{k} << 32) + 5, 17, 3};
                                           }},
                                          {"entry",
                                           [](std::uint32_t k) {
                                             return StreamKey{1, k, 3};
                                           }},
                                          {"upper half of the entry",
                                           [](std::uint32_t k) {
                                             return StreamKey{1, (std::uint64_t{k} << 32) + 5, 3};
                                           }},
                                          {"replicate", [](std::uint32_t k) {
                                             return StreamKey{1, 17, k};
                                           }}};
  return all;
}

TEST(Philox, MeetsTheAnswersOfRandom123) {
  // kat_vectors of Random123 (Salmon et al. 2011), philox4x32 with 10 rounds.
  using Block = std::array<std::uint32_t, 4>;
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({~0u, ~0u, ~0u, ~0u}, {~0u, ~0u}), (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(UnitInterval, IsOpenAndSymmetric) {
  EXPECT_EQ(unit_interval(0), std::ldexp(1.0, -33));
  EXPECT_EQ(unit_interval(~0u), 1.0 - std::ldexp(1.0, -33));
  EXPECT_EQ(unit_interval(0x80000000u) - 0.5, 0.5 - unit_interval(0x7fffffffu));
}

TEST(SobolPoints, EveryAlignedBlockIsANet) {
  // A (0,2)-sequence: of the points [k 2^m, (k+1) 2^m) every elementary interval of area 2^-m holds exactly one. A
  // nested scramble keeps that.
  for (const std::uint64_t seed : {std::uint64_t{1}, std::uint64_t{2}, std::uint64_t{12345}, ~std::uint64_t{0}}) {
    for (const std::uint32_t replicate : {0u, 1u, 31u}) {
      const SamplePoints points(Sampler::sobol, {seed, 7, replicate});
      for (std::uint32_t m = 0; m <= 8; ++m) {
        const std::uint32_t count = 1u << m;
        for (const std::uint32_t block : {0u, 1u, 6u, ~0u >> m}) {
          for (std::uint32_t columns_log2 = 0; columns_log2 <= m; ++columns_log2) {
            const double columns = std::ldexp(1.0, static_cast<int>(columns_log2));
            const double rows = std::ldexp(1.0, static_cast<int>(m - columns_log2));
            std::vector<int> hits(count, 0);
            for (std::uint32_t i = 0; i < count; ++i) {
              const auto [x, y] = points(block * count + i);
              ++hits[static_cast<std::size_t>(std::floor(x * columns) * rows + std::floor(y * rows))];
            }
            ASSERT_EQ(hits, std::vector<int>(count, 1))
                << "seed " << seed << ", replicate " << replicate << ", 2^" << m << " points from " << block * count
                << ", " << columns << " x " << rows;
          }
        }
      }
    }
  }
}

TEST(SamplePoints, StreamsOfDifferentKeysDiffer) {
  // 5 × 4096 first points of 64 bits each: two agree by chance with probability 1e-11.
  for (const Sampler sampler : samplers) {
    std::set<std::array<double, 2>> first_points;
    std::size_t streams = 0;
    for (const KeyFamily& family : key_families()) {
      // From 32, so that no key belongs to two families.
      for (std::uint32_t k = 32; k < 32 + 4096; ++k, ++streams) {
        first_points.insert(SamplePoints(sampler, family.key(k))(0));
      }
    }
    EXPECT_EQ(first_points.size(), streams) << name(sampler);
  }
}

TEST(SamplePoints, BatchesHoldTheSameBits) {
  for (const Sampler sampler : samplers) {
    const SamplePoints points(sampler, {42, 7, 3});
    for (const std::uint32_t first : {0u, 1u, 1000u, 0x7ffffff0u, ~0u - 100u}) {
      // Lengths around those of vectors: bodies and remainders of the loop.
      for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 33u, 100u}) {
        std::vector<double> u(count), v(count);
        points.fill(first, u, v);
        for (std::size_t i = 0; i < count; ++i) {
          const auto [x, y] = points(first + static_cast<std::uint32_t>(i));
          ASSERT_EQ(u[i], x) << name(sampler) << ", point " << first << " + " << i;
          ASSERT_EQ(v[i], y) << name(sampler) << ", point " << first << " + " << i;
        }
      }
    }
  }
}

TEST(SamplePoints, NeighbouringStreamsAreUncorrelated) {
  // Σ 12 (u_k - ½)(u_{k+1} - ½)/√n has variance 1 and is normal for n this large.
  constexpr std::uint32_t n = 1u << 14;
  const double bound = normal_bound(false_alarm);
  for (const Sampler sampler : samplers) {
    for (const KeyFamily& family : key_families()) {
      for (const std::uint32_t index : {0u, 1u, 100u}) {
        std::array<double, 2> previous{}, same{};
        double across = 0.0;  // between the two coordinates of a stream
        for (std::uint32_t k = 0; k < n; ++k) {
          const std::array<double, 2> u = SamplePoints(sampler, family.key(k))(index);
          for (std::size_t d = 0; d < 2; ++d) {
            if (k > 0) same[d] += 12.0 * (u[d] - 0.5) * (previous[d] - 0.5);
          }
          across += 12.0 * (u[0] - 0.5) * (u[1] - 0.5);
          previous = u;
        }
        for (const double sum : {same[0], same[1], across}) {
          EXPECT_LT(std::abs(sum) / std::sqrt(n), bound) << name(sampler) << ", " << family.name << ", point " << index;
        }
      }
    }
  }
}

TEST(SamplePoints, EachPointIsUniformOverItsKeys) {
  constexpr std::uint32_t n = 1u << 14;
  constexpr std::size_t bins = 64;
  const double bound = chi_squared_bound(bins - 1.0, false_alarm);
  for (const Sampler sampler : samplers) {
    for (const KeyFamily& family : key_families()) {
      for (const std::uint32_t index : {0u, 1u, 2u, 3u, 255u, 65535u, ~0u}) {
        std::vector<int> x(bins), y(bins), square(bins), low_bits(bins);
        for (std::uint32_t k = 0; k < n; ++k) {
          const std::array<double, 2> u = SamplePoints(sampler, family.key(k))(index);
          ++x[static_cast<std::size_t>(u[0] * bins)];
          ++y[static_cast<std::size_t>(u[1] * bins)];
          ++square[static_cast<std::size_t>(u[0] * 8) * 8 + static_cast<std::size_t>(u[1] * 8)];
          // Where a point lies inside its cell of 2^-12 is scrambled too.
          const double inside = u[0] * 4096.0;
          ++low_bits[static_cast<std::size_t>((inside - std::floor(inside)) * bins)];
        }
        for (const std::vector<int>& counts : {x, y, square, low_bits}) {
          EXPECT_LT(chi_squared(counts), bound) << name(sampler) << ", " << family.name << ", point " << index;
        }
      }
    }
  }
}

TEST(SamplePoints, ScrambleFlipsEachBitByThoseAboveIt) {
  // Two points that first differ in bit b of a coordinate get independent bits below it: over the seeds, whether the
  // next bits of their scrambled coordinates agree is a fair coin. A plain digit shift would always agree.
  constexpr std::uint32_t n = 1u << 14;
  const double bound = normal_bound(false_alarm) * 0.5 * std::sqrt(n);
  const auto digit = [](double u, int place) { return static_cast<int>(std::floor(std::ldexp(u, place))) & 1; };
  struct Pair {
    std::uint32_t other;
    std::size_t coordinate;
    int first_difference;  // of the unscrambled points 0 and other
  };
  for (const Pair& pair : {Pair{1, 0, 1}, {2, 0, 2}, {4, 0, 3}, {1, 1, 1}, {3, 1, 2}}) {
    for (int place = pair.first_difference + 1; place <= pair.first_difference + 6; ++place) {
      int agree = 0;
      for (std::uint32_t seed = 0; seed < n; ++seed) {
        const SamplePoints points(Sampler::sobol, {seed, 0, 0});
        agree += digit(points(0)[pair.coordinate], place) == digit(points(pair.other)[pair.coordinate], place) ? 1 : 0;
      }
      EXPECT_NEAR(agree, 0.5 * n, bound) << "points 0 and " << pair.other << ", coordinate " << pair.coordinate
                                         << ", bit " << place;
    }
  }
}

/// A smooth integrand of mean (e - 1)(e² - 1)/2.
double integrand(const std::array<double, 2>& u) { return std::exp(u[0] + 2.0 * u[1]); }
const double integral = (std::exp(1.0) - 1.0) * (std::exp(2.0) - 1.0) / 2.0;

double stream_mean(Sampler sampler, const StreamKey& key, std::uint32_t count) {
  const SamplePoints points(sampler, key);
  double sum = 0.0;
  for (std::uint32_t i = 0; i < count; ++i) sum += integrand(points(i));
  return sum / count;
}

TEST(SamplePoints, MeansAreUnbiasedAndTheirErrorsHonest) {
  // (mean - truth)/error follows Student's t with 31 degrees of freedom; mapped to standard normals z, Σ z² is
  // chi-squared. Too small an error and too large an error both fail, each with the false-alarm rate above.
  constexpr int seeds = 4000;
  const boost::math::students_t student(replicate_count - 1);
  for (const Sampler sampler : samplers) {
    for (const std::uint32_t count : {16u, 64u, 100u}) {
      double sum = 0.0, squares = 0.0;
      for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        std::array<double, replicate_count> means;
        for (std::uint32_t r = 0; r < replicate_count; ++r) means[r] = stream_mean(sampler, {seed, 0, r}, count);
        const MeanAndError result = mean_and_error(std::span<const double>(means));
        const double p = boost::math::cdf(student, (result.mean - integral) / result.standard_error);
        const double z = boost::math::quantile(boost::math::normal(), p);
        sum += z;
        squares += z * z;
      }
      const std::string place = name(sampler) + ", " + std::to_string(count) + " points";
      EXPECT_LT(std::abs(sum) / std::sqrt(seeds), normal_bound(false_alarm)) << place;
      EXPECT_LT(squares, chi_squared_bound(seeds, false_alarm)) << place;
      EXPECT_GT(squares, chi_squared_bound(seeds, 1.0 - false_alarm)) << place;
      RecordProperty("chi_squared_per_degree_" + name(sampler) + "_" + std::to_string(count),
                     std::to_string(squares / seeds));
    }
  }
}

TEST(SamplePoints, NestedScramblesConvergeAsTheyShould) {
  // Owen 1997: the variance of a smooth integrand over n nested-scrambled points falls as n^-3 (times a logarithm),
  // over independent points as n^-1. A digit shift alone would give n^-2. Each variance is from 1024 replicates, so
  // its logarithm to base 2 is good to 0.07: the bounds below are ten such errors away.
  const auto variance = [](Sampler sampler, std::uint32_t count) {
    constexpr std::uint32_t replicates = 1024;
    double squares = 0.0;
    for (std::uint32_t r = 0; r < replicates; ++r) {
      const double error = stream_mean(sampler, {1, 0, r}, count) - integral;
      squares += error * error;
    }
    return squares / replicates;
  };
  const double sobol_rate = std::log2(variance(Sampler::sobol, 32) / variance(Sampler::sobol, 512)) / 4.0;
  const double philox_rate = std::log2(variance(Sampler::philox, 32) / variance(Sampler::philox, 512)) / 4.0;
  RecordProperty("sobol_rate", std::to_string(sobol_rate));
  RecordProperty("philox_rate", std::to_string(philox_rate));
  EXPECT_GT(sobol_rate, 2.6);
  EXPECT_NEAR(philox_rate, 1.0, 0.2);
}

// ---- pairs, and the numbers of a path ---------------------------------------------------------------------------

TEST(SamplePairs, EverySobolPairIsANetOfItsOwn) {
  // Padded pairs take the points of an aligned block in another order: still one in every elementary interval.
  for (const std::uint32_t number : {1u, 2u, 7u, 15u}) {
    const SamplePoints points(Sampler::sobol, {3, 7, 1});
    for (const std::uint32_t m : {1u, 4u, 8u}) {
      const std::uint32_t count = 1u << m;
      for (const std::uint32_t block : {0u, 5u, ~0u >> m}) {
        for (std::uint32_t columns_log2 = 0; columns_log2 <= m; ++columns_log2) {
          const double columns = std::ldexp(1.0, static_cast<int>(columns_log2));
          const double rows = std::ldexp(1.0, static_cast<int>(m - columns_log2));
          std::vector<int> hits(count, 0);
          for (std::uint32_t i = 0; i < count; ++i) {
            const auto [x, y] = points.pair(block * count + i, number);
            ++hits[static_cast<std::size_t>(std::floor(x * columns) * rows + std::floor(y * rows))];
          }
          ASSERT_EQ(hits, std::vector<int>(count, 1)) << "pair " << number << ", 2^" << m << " points";
        }
      }
    }
  }
}

TEST(SamplePairs, AreIndependentOfOneAnother) {
  // Over keys, and over the indices of one stream: Σ 12 (a - ½)(b - ½)/√n of numbers from two pairs is nearly standard
  // normal. Over indices Sobol's sums may only be smaller, nets being evener than chance.
  constexpr std::uint32_t n = 1u << 14;
  const double bound = normal_bound(false_alarm);
  for (const Sampler sampler : samplers) {
    for (const auto& [first, second] : {std::pair{0u, 1u}, {1u, 2u}, {3u, 15u}, {15u, 16u}, {16u, 17u}, {2u, 40u}}) {
      for (const bool over_keys : {true, false}) {
        std::array<double, 4> sums{};
        for (std::uint32_t k = 0; k < n; ++k) {
          const SamplePoints points(sampler, {over_keys ? k : 8u, 17, 3});
          const std::uint32_t index = over_keys ? 5 : k;
          const auto a = points.pair(index, first), b = points.pair(index, second);
          for (std::size_t d = 0; d < 4; ++d) sums[d] += 12.0 * (a[d / 2] - 0.5) * (b[d % 2] - 0.5);
        }
        for (const double sum : sums) {
          EXPECT_LT(std::abs(sum) / std::sqrt(n), bound)
              << name(sampler) << ", pairs " << first << " and " << second << (over_keys ? ", over keys" : "");
        }
      }
    }
  }
}

TEST(PathNumbers, AreThePairsInTheirOrder) {
  for (const Sampler sampler : samplers) {
    const SamplePoints points(sampler, {6, 5, 4});
    PathNumbers numbers(points, 9);
    EXPECT_EQ(numbers.next_pair(), points.pair(9, 0));
    EXPECT_EQ(numbers.next(), points.pair(9, 1)[0]);
    EXPECT_EQ(numbers.next(), points.pair(9, 1)[1]);
    EXPECT_EQ(numbers.next(), points.pair(9, 2)[0]);
    // A pair starts afresh; the spare number is dropped.
    EXPECT_EQ(numbers.next_pair(), points.pair(9, 3));
    EXPECT_EQ(numbers.next(), points.pair(9, 4)[0]);
    for (std::uint32_t number = 5; number < 100; ++number) {
      EXPECT_EQ(numbers.next_pair(), points.pair(9, number)) << number;
    }
  }
}

TEST(FloatPairs, AreTheCellsOfTheirDoubles) {
  for (const Sampler sampler : samplers) {
    const SamplePoints points(sampler, {42, 7, 3});
    for (const std::uint32_t number : {0u, 1u, 2u, 15u, 16u, 40u, 32767u}) {
      for (const std::size_t count : {0u, 1u, 15u, 16u, 17u, 100u}) {
        std::vector<std::uint32_t> indices;
        for (std::uint32_t i = 0; i < count; ++i) indices.push_back(i * 0x9E3779B9u);
        // Longer than the indices: what lies beyond stays.
        std::vector<float> u(count + 3, -1.0f), v(count + 3, -1.0f);
        points.fill(number, indices, u, v);
        for (std::size_t i = 0; i < count; ++i) {
          const auto pair = points.pair(indices[i], number);
          const auto cell = [](double x) { return static_cast<float>((std::floor(x * 0x1p23) + 0.5) * 0x1p-23); };
          ASSERT_EQ(u[i], cell(pair[0])) << name(sampler) << ", pair " << number << ", index " << indices[i];
          ASSERT_EQ(v[i], cell(pair[1])) << name(sampler) << ", pair " << number << ", index " << indices[i];
          ASSERT_GT(u[i], 0.0f);
          ASSERT_LT(u[i], 1.0f);
        }
        for (std::size_t i = count; i < count + 3; ++i) ASSERT_EQ(u[i], -1.0f);
      }
    }
  }
}

}  // namespace
}  // namespace lobefit
