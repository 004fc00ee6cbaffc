// A material beside its fit: slices on a logarithmic scale, from the mirror direction to the tails, and lit spheres.
#pragma once

#include <span>
#include <string>

#include "report/figure.h"
#include "report/sphere.h"

namespace lobefit {

/// f cos θi in the plane of incidence at four views: measured as points, fitted as lines, in the colours of the
/// channels; the mirror side at negative θi. `fitted` holds values as in Table::values, over the same grid. `spheres`:
/// measured and fitted, in one lighting and of one size, shown at one exposure; or none. Throws Error(usage) for a
/// table whose coordinates are not spherical.
std::string material_figure(const Table& measured, std::span<const float> fitted, std::span<const SphereImage> spheres,
                            const std::string& title, const std::string& subtitle);
FigureSize material_figure_size();

}  // namespace lobefit
