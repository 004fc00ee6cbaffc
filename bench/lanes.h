// The reference's vectorised kernels, as the library has them and as the same text compiled scalar.
#pragma once

#include <cstdint>

namespace vector_lanes {
/// One configuration from disk points that are made once.
double mean_cosine(std::uint32_t facets, bool isotropic);
/// One configuration by way of a row: points, facets, one light.
double points_and_cosines(std::uint32_t facets);
/// Paths of all bounces towards one light; a multiple of 1024.
double walk(std::uint32_t paths, bool philox);
}  // namespace vector_lanes

namespace scalar_lanes {
double mean_cosine(std::uint32_t facets, bool isotropic);
double points_and_cosines(std::uint32_t facets);
double walk(std::uint32_t paths, bool philox);
}  // namespace scalar_lanes
