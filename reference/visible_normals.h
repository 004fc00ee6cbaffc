// Sampling of the facet normals that a direction sees.
#pragma once

#include <array>
#include <span>

#include "models/geometry.h"
#include "models/microfacet/distribution.h"

namespace lobefit {

/// A facet normal m with density D(m) (w·m)⁺ G1(w) / (w·n), w unit. A w below the
/// horizon sees facets too, those that lean towards it; there D (w·m)⁺ is normalised by its own integral.
///
/// GGX: a disk is mapped to the visible half of the stretched hemisphere (Heitz 2018, Sampling the GGX Distribution of
/// Visible Normals); smooth in u. Beckmann: the visible slope along w by inversion of its distribution function, the
/// slope across by the inverse error function (Heitz, d'Eon 2014, section 5 of the supplement).
Direction sample_visible_normal(Distribution distribution, Alpha alpha, const Direction& w,
                                const std::array<double, 2>& u);

/// Facets in float, one array per component.
struct FacetBatch {
  std::span<float> x, y, z;
};

/// The same for many points in float; vectorised for GGX.
void sample_visible_normals(Distribution distribution, Alpha alpha, const Direction& w, std::span<const float> u,
                            std::span<const float> v, const FacetBatch& facets);

}  // namespace lobefit
