// Directional albedo: what share of the light a surface sends back.
#pragma once

#include <functional>

#include "models/geometry.h"
#include "reference/references.h"

namespace lobefit {

struct Albedo {
  Rgb value, error;  // error: difference of the last two refinements
};

enum class FixedDirection { view, light };

/// What light is counted by, and over which directions.
enum class AlbedoDomain {
  hemisphere,  // cosine above the surface
  sphere,      // |cosine| on both sides of it
  fibre,       // all around, without cosine: f of a fibre carries its own
};

/// ∫ f cosine dω over the direction that is not fixed, the fixed one at `theta` radians. Gauss-Legendre panels in
/// the polar angle × midpoints in azimuth, both doubled until two refinements agree to `tolerance` (relative) or 256
/// panels are reached. `monitor` hears of each refinement and may stop it.
Albedo directional_albedo(const std::function<Rgb(const Direction& wi, const Direction& wo)>& brdf, double theta,
                          FixedDirection fixed, AlbedoDomain domain = AlbedoDomain::hemisphere, double tolerance = 1e-6,
                          Monitor* monitor = nullptr);

/// The same by Monte Carlo, for any reference.
Estimate estimate_albedo(const Integrator& integrator, double theta, FixedDirection fixed, AlbedoDomain domain,
                         const SamplingOptions& options, Monitor* monitor = nullptr);

}  // namespace lobefit
