// The library's sources once more, without clones; CMake switches the vectoriser off for this file.
#define LOBEFIT_NO_CLONES
#define LANES_NAMESPACE scalar_lanes
#define lobefit lobefit_scalar
#include "bench/lanes.inc"
#include "reference/diffuse/single_kernel.cpp"
#include "reference/diffuse/walk_lanes.cpp"
#include "reference/sample_points.cpp"
#include "reference/visible_normals.cpp"
