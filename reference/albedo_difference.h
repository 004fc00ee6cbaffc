// How far apart two BRDFs are in directional albedo.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "reference/brdf_pair.h"

namespace lobefit {

/// Integrals over the hemispheres need a table that covers them: its quadrature must find at least this share of the
/// cosines' own integral, and at most as much more.
inline constexpr double least_coverage = 0.8, most_coverage = 1.2;

/// Albedo at one view angle: the mean BRDF, weighted by cos theta_i, over the lights at which both have a value, times
/// π.
struct AlbedoAtAngle {
  std::size_t row;  // of the table's parameter axes
  double theta_o;   // degrees
  std::vector<double> truth, other;
  double coverage;  // share of the hemisphere's ∫ cos theta_i dω_i at which both have a value

  double absolute(std::size_t channel) const { return std::abs(other[channel] - truth[channel]); }
  /// Nothing where the truth is black.
  std::optional<double> relative(std::size_t channel) const;
};

struct WorstAndMean {
  double worst, mean;
};

struct AlbedoDifference {
  std::string method;                 // grid, rings or half_vector: see albedo_difference()
  std::vector<AlbedoAtAngle> angles;  // of each parameter row
  WorstAndMean absolute;              // over angles and channels; the mean by the angles' quadrature weights
  std::optional<WorstAndMean> relative;
};

/// By the table's own quadrature on a grid of angles; elsewhere by HalfVectorRule where both are known at any
/// directions, or over rings of entries with one view angle where a list has them. `quadrature` is
/// Table::quadrature_weights(). Nothing where no view has lights all over its hemisphere.
std::optional<AlbedoDifference> albedo_difference(const BrdfPair& pair, const std::vector<double>& quadrature);

/// The azimuths of a spherical table as a share of those they stand for: half the circle, the other being its mirror
/// image, or the whole of it.
double azimuth_share(const Axis& phi);

}  // namespace lobefit
