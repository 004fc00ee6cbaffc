// A model's own sampling over the whole sphere of lights: what transmits, fibres, and facets that reflect below the
// horizon.
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

/// ∫ pdf dω over a cell of z and azimuth. In parts, for the density has a kink where facets turn away from wo; in more
/// of them next to -wo, where half vectors' densities go as 1/|wi + wo|. In the polar angle: those of fibres go as its
/// inverse sine at the ends of the axis.
inline double share_of_cell(const Model& model, std::span<const double> flat, const Direction& wo,
                            std::pair<double, double> z, std::pair<double, double> phi) {
  const Direction middle = direction(std::acos(0.5 * (z.first + z.second)), 0.5 * (phi.first + phi.second));
  const bool next_to_pole = !is_hair(model.info->kind) && dot(middle, wo) < -0.9;
  const int parts = next_to_pole ? 24 : 4;
  const double top = std::acos(z.second), height = std::acos(z.first) - top, width = phi.second - phi.first;
  double share = 0.0;
  for (int part = 0; part < parts * parts; ++part) {
    const double above = top + height * (part / parts) / parts, left = phi.first + width * (part % parts) / parts;
    for (const auto& [theta, theta_weight] : gauss_legendre(6, above, above + height / parts)) {
      for (const auto& [turn, turn_weight] : gauss_legendre(6, left, left + width / parts)) {
        share += theta_weight * std::sin(theta) * turn_weight * model.pdf(flat, direction(theta, turn), wo);
      }
    }
  }
  return share;
}

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
      const double share = share_of_cell(model, flat, wo, {2.0 * band / bands - 1.0, 2.0 * (band + 1.0) / bands - 1.0},
                                         {2.0 * pi * turn / turns, 2.0 * pi * (turn + 1.0) / turns});
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

/// |cos θ_i|, or 1 around a fibre, whose S wants no cosine.
inline double light_weight(const Model& model, const Direction& wi) {
  return is_hair(model.info->kind) ? 1.0 : std::abs(wi.z);
}

/// ∫ f |cos θ_i| dω_i by the model's own samples on a midpoint grid of their numbers, the first channel.
inline double sampled_albedo(const Model& model, std::span<const double> flat, const Direction& wo, int steps) {
  double sum = 0.0;
  for (int i = 0; i < steps * steps; ++i) {
    const Direction wi = model.sample(flat, wo, {(i / steps + 0.5) / steps, (i % steps + 0.5) / steps});
    const double f = model.evaluate(flat, wi, wo).x;
    if (f != 0.0) sum += f * light_weight(model, wi) / model.pdf(flat, wi, wo);
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
        sum += model.evaluate(flat, wi, wo).x * light_weight(model, wi) * weight * 2.0 * pi / azimuths;
      }
    }
  }
  return sum;
}

}  // namespace lobefit
