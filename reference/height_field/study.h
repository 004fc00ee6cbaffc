// Explicit Gaussian surfaces against Smith's theory of them: does what the references assume hold?
//
// Smith takes heights and slopes at different points as independent. On a real surface both are correlated over ℓ, so
// that what one direction sees depends on what another one sees.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "reference/estimate.h"
#include "reference/height_field/height_field.h"
#include "reference/monitor.h"

namespace lobefit {

struct HeightFieldOptions {
  double alpha = 0.5;                                // Beckmann's
  int surfaces = 16;                                 // independent ones: the replicates behind every standard error
  int cells = 512;                                   // across a surface
  double correlation_length = 16.0;                  // ℓ in cells; 8 or 32 give the same within errors, 4 does not
  std::uint32_t samples = 1u << 14;                  // paths per surface and view
  std::vector<double> theta{0.0, 30.0, 60.0, 80.0};  // of the views, and of the lights in the table, in degrees
  std::uint64_t seed = 1;
};

/// The explicit surface beside Smith's.
struct Comparison {
  MeanAndError surface, smith;

  /// Of the surface from Smith's theory, relative to that.
  double difference() const { return surface.mean / smith.mean - 1.0; }
  double difference_error() const { return std::hypot(surface.standard_error, smith.standard_error) / smith.mean; }
  /// The same in standard errors.
  double deviations() const {
    const double error = difference_error();
    return error > 0.0 ? difference() / error : 0.0;
  }
};

/// One pair of directions, in degrees; φ = 0 is the retro side. BRDFs per unit of albedo, 1/sr.
struct HeightFieldPair {
  double theta_o, theta_i, phi;
  Comparison first, second;  // orders of scattering; Smith's height-correlated
  Comparison all;            // all orders at unit albedo
  double separable, unmasked;
};

struct HeightFieldView {
  double theta_o;
  Comparison facing_area;          // of the facets that face the view: tests the slopes alone
  Comparison first, second, rest;  // directional albedo of the orders 1, 2, and from 3 on, at unit albedo
};

/// Facet slopes relative to alpha/√2, and moments; a Gaussian has 1, 1, 3, 3, 0.
struct HeightFieldSlopes {
  MeanAndError rms_x, rms_y, kurtosis_x, kurtosis_y, correlation;
};

struct HeightFieldStudy {
  HeightFieldOptions options;
  HeightFieldSlopes slopes;
  std::vector<HeightFieldPair> pairs;  // views × lights: θi of the options at φ = 0, 90, 180, and a slice every 5°
  std::vector<HeightFieldView> views;
  std::uint64_t paths = 0, lost = 0;

  int degrees_of_freedom() const { return options.surfaces - 1; }
  /// Standard errors that a mean over the surfaces exceeds, either way, with this probability: Student's t.
  double t_quantile(double probability) const;
  /// Pairs of a view in the plane of incidence, by signed θi; retro positive.
  std::vector<HeightFieldPair> slice(double theta_o) const;
  /// Pairs whose θi is one of the options'.
  std::vector<HeightFieldPair> table() const;
  /// Where the theory holds and where it fails, in words.
  std::string conclusion() const;
};

/// Throws Error(usage) for options out of range, Error(missing_part) in a build without Embree.
HeightFieldStudy study_height_field(const HeightFieldOptions& options, Monitor& monitor);

}  // namespace lobefit
