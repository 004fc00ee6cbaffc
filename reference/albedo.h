// Directional albedo: what share of the light a surface sends back.
#pragma once

#include <functional>

#include "models/geometry.h"

namespace lobefit {

struct Albedo {
  Rgb value, error;  // error: difference of the last two refinements
};

enum class FixedDirection { view, light };

/// ∫ f cosine dω over the direction that is not fixed, the fixed one at `theta` radians. Gauss-Legendre panels in
/// the polar angle × midpoints in azimuth, both doubled until two refinements agree to `tolerance` (relative) or 256
/// panels are reached.
Albedo directional_albedo(const std::function<Rgb(const Direction& wi, const Direction& wo)>& brdf, double theta,
                          FixedDirection fixed, double tolerance = 1e-6);

}  // namespace lobefit
