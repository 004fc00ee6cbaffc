// Directional albedos of Substrate's closures.
#pragma once

#include "models/substrate/walk.h"

namespace lobefit {

/// ∫ f cosine dω_i for a viewer at wo: stratified importance sampling of each closure, steps² directions each; to about
/// 1e-3 at 24 steps.
Rgb directional_albedo(const std::vector<Closure>& closures, const Direction& wo, int steps = 24);

/// Of each closure alone: what a path tracer chooses by (S2: one closure, with probability in proportion).
std::vector<Rgb> closure_albedos(const std::vector<Closure>& closures, const Direction& wo, int steps = 24);

}  // namespace lobefit
