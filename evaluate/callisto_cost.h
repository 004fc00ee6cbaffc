// What Callisto's diffuse part costs by itself.
#pragma once

#include "evaluate/expression.h"

namespace lobefit {

/// Operations of c1 on Lambert, without specular lobes, tints and terminator: what callisto_lambert comes to as a
/// diffuse model, f0 and specular_fresnel_falloff 0, tints 1, terminator 0.
OperationCount callisto_diffuse_operations();

}  // namespace lobefit
