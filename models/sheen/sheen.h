// What the sheen models share.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

inline constexpr ParameterInfo sheen_color_parameter{
    .name = "color", .symbol = "C", .initial = 1.0, .doc = "Scales the lobe, linear Rec.709 RGB."};

}  // namespace lobefit
