// Monte Carlo paths over an explicit height field.
#pragma once

#include "reference/height_field/scattering.h"
#include "reference/height_field/tracer.h"

namespace lobefit {

/// Follows `count` paths, numbers `first` on of a stream, that enter from the viewer wo and cross the macroscopic plane
/// uniformly: the mean over paths is the mean over the surface as wo sees it. Facets are Lambertian of unit albedo; at
/// each of them every light is asked for by a shadow ray (next-event estimation), then the path goes on until it finds
/// the sky. Adds to `sums`.
///
///   f_k = E[(m_k·wi)⁺ V(x_k, wi)] / (π μi),   E_k = P(sky after facet k)
void add_paths(const HeightFieldTracer& tracer, const Direction& wo, std::span<const Direction> wi,
               const SamplePoints& points, std::uint32_t first, std::uint32_t count, ScatteringOrders& sums);

}  // namespace lobefit
