// What no float arithmetic can promise.
#pragma once

#include <array>
#include <span>

#include "models/registry.h"

namespace lobefit {

/// Largest error that an ill-conditioned formula may show in float, per channel: twice what its value moves by when
/// each input in turn, parameters and components of wi and wo, moves by one float ulp (relative 2⁻²³).
std::array<double, 3> float_conditioning(const Model& model, std::span<const double> flat, Direction wi, Direction wo);

}  // namespace lobefit
