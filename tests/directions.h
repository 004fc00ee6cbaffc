// The pairs of directions and the parameter values on which tests evaluate models.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "models/geometry.h"
#include "models/parameter.h"

namespace lobefit {

/// Uniform numbers in [0, 1), the same with every standard library.
class UniformNumbers {
 public:
  explicit UniformNumbers(std::uint64_t seed) : engine_(seed) {}
  double operator()() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double between(double lower, double upper) { return lower + (upper - lower) * (*this)(); }

 private:
  std::mt19937_64 engine_;
};

struct DirectionPair {
  Direction wi, wo;
};

/// Pairs of directions, each uniform over the upper hemisphere.
inline std::vector<DirectionPair> random_pairs(std::size_t count, std::uint64_t seed) {
  UniformNumbers uniform(seed);
  const auto upper_direction = [&] {
    const double cosine = 1.0 - uniform();
    const double sine = std::sqrt((1.0 - cosine) * (1.0 + cosine));
    const double azimuth = 2.0 * pi * uniform();
    return Direction{sine * std::cos(azimuth), sine * std::sin(azimuth), cosine};
  };
  std::vector<DirectionPair> pairs(count);
  for (auto& [wi, wo] : pairs) wi = upper_direction(), wo = upper_direction();
  return pairs;
}

/// Where formulas break: the normal, grazing angles down to the last bits, retro and (nearly) opposite directions.
inline std::vector<DirectionPair> hostile_pairs() {
  constexpr std::array cosines{1.0, 1.0 - 1e-12, 0.999, 0.7, 0.1, 1e-3, 1e-6, 1e-12, 1e-30};
  struct Azimuth {
    double cosine, sine;
  };
  constexpr Azimuth azimuths[] = {{1.0, 0.0}, {1.0, 1e-9}, {0.6, 0.8}, {0.0, 1.0}, {-1.0, 1e-9}, {-1.0, 0.0}};
  std::vector<DirectionPair> pairs;
  for (const double cosine_i : cosines) {
    for (const double cosine_o : cosines) {
      for (const auto& [cosine, sine] : azimuths) {
        const double sine_i = std::sqrt((1.0 - cosine_i) * (1.0 + cosine_i));
        const double sine_o = std::sqrt((1.0 - cosine_o) * (1.0 + cosine_o));
        pairs.push_back({Direction{sine_i, 0.0, cosine_i}, Direction{sine_o * cosine, sine_o * sine, cosine_o}});
      }
    }
  }
  return pairs;
}

/// Flat values at every corner of the parameter box; at 64 random corners where there are more. RGB moves as one.
inline std::vector<std::vector<double>> corner_parameters(const std::vector<ParameterInfo>& list, std::uint64_t seed) {
  constexpr std::size_t most = 64;
  const std::size_t count = list.size() <= 6 ? std::size_t{1} << list.size() : most;
  UniformNumbers uniform(seed);
  std::vector<std::vector<double>> corners(count);
  for (std::size_t corner = 0; corner < count; ++corner) {
    for (std::size_t i = 0; i < list.size(); ++i) {
      const bool upper = list.size() <= 6 ? ((corner >> i) & 1) != 0 : uniform() < 0.5;
      corners[corner].insert(corners[corner].end(), static_cast<std::size_t>(list[i].components),
                             upper ? list[i].upper : list[i].lower);
    }
  }
  return corners;
}

/// Flat values drawn from inside the box, `margin` of each range away from its ends.
inline std::vector<std::vector<double>> interior_parameters(const std::vector<ParameterInfo>& list, std::size_t count,
                                                            double margin, std::uint64_t seed) {
  UniformNumbers uniform(seed);
  std::vector<std::vector<double>> sets(count);
  for (std::vector<double>& flat : sets) {
    for (const ParameterInfo& info : list) {
      const double range = info.upper - info.lower;
      for (int k = 0; k < info.components; ++k) {
        flat.push_back(uniform.between(info.lower + margin * range, info.upper - margin * range));
      }
    }
  }
  return sets;
}

}  // namespace lobefit
