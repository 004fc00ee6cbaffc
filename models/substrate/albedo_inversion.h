// What a semi-infinite medium reflects, and back: artists give the colour after all scattering.
//
// Van de Hulst's fit for the light that returns under diffuse light (1980, Multiple Light Scattering; Kulla,
// Conty 2017, Revisiting Physically Based Shading at Imageworks): with s = √((1 - ω)/(1 - g ω)),
//
//   ρ = (1 - s)(1 - .139 s)/(1 + 1.17 s).
//
// Kulla and Conty print its inverse as 4.09712 + 4.20863 ρ - √(9.59217 + 41.6808 ρ + 17.7126 ρ²), which loses its
// digits next to ρ = 1. The quadratic's other form does not, and is the inverse to the last bits. The fit errs against
// adding-doubling by .0021 at most where g = 0, by .0014 where g = .5 and .8 (tests/thin_scattering_test.cpp).
#pragma once

#include "models/scalar.h"

namespace lobefit {

/// ρ in [0, 1] of a semi-infinite medium of single scattering albedo ω in [0, 1], g in (-1, 1).
struct SemiInfiniteAlbedo {
  static constexpr const char* name = "semi_infinite_albedo";
  static constexpr std::array arguments{"single_scattering_albedo", "g"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& single_scattering_albedo, const T& g) {
    const T albedo = let("albedo", saturate(single_scattering_albedo));
    const T s = let("s", sqrt((1.0 - albedo) / (1.0 - g * albedo)));
    return (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s);
  }
};

/// s² in [0, 1] of the semi-infinite medium that returns the share ρ in [0, 1].
struct SemiInfiniteSimilarity {
  static constexpr const char* name = "semi_infinite_similarity";
  static constexpr std::array arguments{"albedo"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& albedo) {
    const T rho = let("rho", saturate(albedo));
    const T b = let("b", 1.139 + 1.17 * rho);
    const T s = let("s", 2.0 * (1.0 - rho) / (b + sqrt(b * b - 0.556 * (1.0 - rho))));
    return min(s * s, 1.0);
  }
};

/// ω in [0, 1] of that medium; g in (-1, 1).
struct SingleScatteringAlbedo {
  static constexpr const char* name = "single_scattering_albedo";
  static constexpr std::array arguments{"albedo", "g"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& albedo, const T& g) {
    const T s2 = let("s2", call<SemiInfiniteSimilarity>(albedo));
    return (1.0 - s2) / (1.0 - g * s2);
  }
};

/// 1 - ω of that medium. Of a white one float has no digits left in ω.
struct SingleScatteringAbsorption {
  static constexpr const char* name = "single_scattering_absorption";
  static constexpr std::array arguments{"albedo", "g"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& albedo, const T& g) {
    const T s2 = let("s2", call<SemiInfiniteSimilarity>(albedo));
    return (1.0 - g) * s2 / (1.0 - g * s2);
  }
};

/// Of each channel.
template <class T>
LOBEFIT_TEXT Vec3<T> single_scattering_albedo(const Vec3<T>& albedo, const T& g) {
  return {call<SingleScatteringAlbedo>(albedo.x, g), call<SingleScatteringAlbedo>(albedo.y, g),
          call<SingleScatteringAlbedo>(albedo.z, g)};
}

}  // namespace lobefit
