// Smith's surface with all its bounces, written apart from the reference integrators so that it can witness for them.
#pragma once

#include "models/microfacet/distribution.h"
#include "reference/height_field/scattering.h"

namespace lobefit {

/// A facet normal with density D(m) (w·m)⁺ / σ(w); w may point below the horizon, as the reverse of a rising ray does.
/// GGX by spherical caps (Dupuy, Benyoub 2023, Sampling Visible GGX Normals with Spherical Caps); Beckmann by inversion
/// of the distribution of the slope along w.
Direction smith_visible_normal(Distribution distribution, double alpha, const Direction& w, double u,
                               const std::array<double, 2>& v);

/// Random walk of Heitz, Hanika, d'Eon, Dachsbacher 2016 (Multiple-Scattering Microfacet BSDFs with the Smith Model) on
/// Lambertian facets. With τ = -ln C1(h) the distribution of heights drops out: a ray that falls meets facets at the
/// rate 1 + Λ per unit of τ, one that rises at the rate Λ until it is out at τ = 0. As add_paths() otherwise.
void add_smith_walks(Distribution distribution, double alpha, const Direction& wo, std::span<const Direction> wi,
                     const SamplePoints& points, std::uint32_t first, std::uint32_t count, ScatteringOrders& sums);

}  // namespace lobefit
