// A model's own sampling over the whole sphere of lights: what transmits, and facets that reflect below the horizon.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "models/registry.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"

namespace lobefit {

struct SamplingFit {
  double chi2 = 0.0;
  int cells = 0;
};

/// Pearson's χ² of 200,000 samples against pdf(), over 20 bands in z by 16 azimuths, and ∫ pdf. Cells that expect fewer
/// than 8 samples are left out. Five deviations: a right sampling fails about once in a million runs; the seed is
/// fixed. `lost`: the share of samples that a half vector may lose, facets that face away from wo reflecting nothing.
inline SamplingFit expect_samples_follow_pdf(const Model& model, std::span<const double> flat, const Direction& wo,
                                             double lost = 0.0) {
  constexpr int bands = 20, turns = 16, count = 200'000;
  UniformNumbers uniform(91);
  std::vector<double> hits(bands * turns);
  for (int i = 0; i < count; ++i) {
    const double u0 = uniform(), u1 = uniform();
    const Direction wi = model.sample(flat, wo, {u0, u1});
    EXPECT_NEAR(dot(wi, wi), 1.0, 1e-9) << model.info->name;
    const double turn = std::atan2(wi.y, wi.x) / (2.0 * pi);
    const int band = std::min(bands - 1, static_cast<int>(bands * 0.5 * (1.0 + wi.z)));
    const int sector = std::min(turns - 1, static_cast<int>(turns * (turn < 0.0 ? turn + 1.0 : turn)));
    ++hits[static_cast<std::size_t>(band * turns + sector)];
  }
  double chi2 = 0.0, total = 0.0;
  int cells = 0;
  for (int band = 0; band < bands; ++band) {
    for (int turn = 0; turn < turns; ++turn) {
      // In parts: the density has a kink where facets turn away from wo.
      constexpr int parts = 4;
      double share = 0.0;
      for (int part = 0; part < parts * parts; ++part) {
        const double low = (band + static_cast<double>(part / parts) / parts) / bands;
        const double left = (turn + static_cast<double>(part % parts) / parts) / turns;
        for (const auto& [z, wz] : gauss_legendre(6, 2.0 * low - 1.0, 2.0 * (low + 1.0 / (parts * bands)) - 1.0)) {
          for (const auto& [phi, wphi] :
               gauss_legendre(6, 2.0 * pi * left, 2.0 * pi * (left + 1.0 / (parts * turns)))) {
            share += wz * wphi * model.pdf(flat, direction(std::acos(z), phi), wo);
          }
        }
      }
      total += share;
      const double expected = share * count, seen = hits[static_cast<std::size_t>(band * turns + turn)];
      if (expected < 8.0) continue;
      chi2 += (seen - expected) * (seen - expected) / expected;
      ++cells;
    }
  }
  EXPECT_LE(total, 1.0 + 3e-3) << model.info->name;
  EXPECT_GE(total, 1.0 - 3e-3 - lost) << model.info->name;
  EXPECT_LT(chi2, cells + 5.0 * std::sqrt(2.0 * cells)) << model.info->name;
  return {chi2, cells};
}

/// ∫ f |cos θ_i| dω_i by the model's own samples on a midpoint grid of their numbers, the first channel.
inline double sampled_albedo(const Model& model, std::span<const double> flat, const Direction& wo, int steps) {
  double sum = 0.0;
  for (int i = 0; i < steps * steps; ++i) {
    const Direction wi = model.sample(flat, wo, {(i / steps + 0.5) / steps, (i % steps + 0.5) / steps});
    const double f = model.evaluate(flat, wi, wo).x;
    if (f != 0.0) sum += f * std::abs(wi.z) / model.pdf(flat, wi, wo);
  }
  return sum / (steps * steps);
}

/// The same by quadrature over both hemispheres, for lobes without sharp peaks.
inline double integrated_albedo(const Model& model, std::span<const double> flat, const Direction& wo) {
  constexpr int azimuths = 128;
  double sum = 0.0;
  for (const auto& [lower, upper] : {std::pair{-1.0, -0.5}, {-0.5, 0.0}, {0.0, 0.5}, {0.5, 1.0}}) {
    for (const auto& [z, weight] : gauss_legendre(48, lower, upper)) {
      const double sine = std::sqrt((1.0 - z) * (1.0 + z));
      for (int k = 0; k < azimuths; ++k) {
        const double azimuth = 2.0 * pi * (k + 0.5) / azimuths;
        const Direction wi{sine * std::cos(azimuth), sine * std::sin(azimuth), z};
        sum += model.evaluate(flat, wi, wo).x * std::abs(z) * weight * 2.0 * pi / azimuths;
      }
    }
  }
  return sum;
}

}  // namespace lobefit
