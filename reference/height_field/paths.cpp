#include "reference/height_field/paths.h"

#include <algorithm>

namespace lobefit {

namespace {

/// A path this long hasn't been seen; at unit albedo each facet lets it go with a fair probability.
constexpr std::size_t longest_path = 10000;

}  // namespace

void add_paths(const HeightFieldTracer& tracer, const Direction& wo, std::span<const Direction> wi,
               const SamplePoints& points, std::uint32_t first, std::uint32_t count, ScatteringOrders& sums) {
  const HeightField& surface = tracer.surface();
  for (std::uint32_t path = first; path < first + count; ++path) {
    PathNumbers numbers(points, path);
    const std::array<double, 2> start = numbers.next_pair();
    const Direction origin{surface.cells() * (start[0] - 0.5), surface.cells() * (start[1] - 0.5),
                           surface.highest() + 0.5};
    Encounter encounter = tracer.trace(origin, -wo);
    for (std::size_t order = 0; encounter.what == Encounter::What::facet; ++order) {
      const std::size_t index = std::min(order, sums.orders - 1);
      for (std::size_t j = 0; j < wi.size(); ++j) {
        const double cosine = dot(encounter.normal, wi[j]);
        if (cosine > 0.0 && tracer.sees_sky(encounter.point, wi[j])) {
          sums.brdf[index * wi.size() + j] += cosine / (pi * wi[j].z);
        }
      }
      const Direction out = cosine_direction(encounter.normal, numbers.next_pair());
      encounter = order < longest_path ? tracer.trace(encounter.point, out) : Encounter{Encounter::What::lost};
      if (encounter.what == Encounter::What::sky) sums.albedo[index] += 1.0;
    }
    if (encounter.what == Encounter::What::lost) ++sums.lost;
  }
}

}  // namespace lobefit
