// Integrals over the facets that two directions share, by quadrature.
#pragma once

#include <functional>

#include "models/geometry.h"
#include "models/microfacet/distribution.h"

namespace lobefit {

/// K(a, b) = ∫ (a·m)⁺ (b·m)⁺ D(m) dm of an isotropic distribution: the azimuth of m in closed form over the arcs where
/// both sides are visible, the slope numerically between the slopes where those arcs change. Relative error estimate
/// below 1e-11 where K is not vanishing.
double shared_visibility(Distribution distribution, double alpha, const Direction& a, const Direction& b);

/// ∫ (a·m)⁺ (b·m)⁺ weight(m) D(m) dm of any distribution, the azimuth numerically too: relative error below 1e-8 for
/// smooth weights, mostly far less.
double shared_visibility(Distribution distribution, Alpha alpha, const Direction& a, const Direction& b,
                         const std::function<double(const Direction& m)>& weight);

}  // namespace lobefit
