// Image slices: BRDFs over theta_h and theta_d, where each effect has its place (Burley 2012, Physically-Based Shading
// at Disney, section 3): the lobe at the left, Fresnel at the top, retroreflection at the bottom, grazing at the right.
//
//   write_figure(image_slice_figure({{"measured", file}, {"fit", model}}, {}, "Aurora white"), "slice.png", false);
#pragma once

#include <string>
#include <vector>

#include "report/figure.h"
#include "report/sphere.h"

namespace lobefit {

struct LabelledBrdf {
  std::string label;
  SphereBrdf brdf;
};

struct ImageSliceOptions {
  double phi_d = 90.0;  // degrees
  int steps = 90;       // cells along each angle
};

/// A column per BRDF: π f on one logarithmic scale, and under those after the first their ratio to the first in stops
/// (factors of two), on a scale that is white at 0. Where a direction is below the surface, or a BRDF has no value or
/// none above 0, panels are grey. Throws Error(usage) without BRDFs, for phi_d outside [0, 180], or if the first has no
/// value at all.
std::string image_slice_figure(const std::vector<LabelledBrdf>& brdfs, const ImageSliceOptions& options,
                               const std::string& title);
/// A size that makes panels square.
FigureSize image_slice_figure_size(std::size_t brdfs);

}  // namespace lobefit
