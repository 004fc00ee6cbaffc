// Directional albedos of Substrate's closures.
#pragma once

#include "models/substrate/walk.h"

namespace lobefit {

/// ∫ f cosine dω_i for a viewer at wo: importance sampling of each closure, steps² directions each. At 24 steps the
/// error over the shipped trees is 1e-4 in the median and 2e-3 at most.
Rgb directional_albedo(const std::vector<Closure>& closures, const Direction& wo, int steps = 24);

/// Of each closure alone: what a path tracer chooses by (S2: one closure, with probability in proportion).
std::vector<Rgb> closure_albedos(const std::vector<Closure>& closures, const Direction& wo, int steps = 24);

}  // namespace lobefit
