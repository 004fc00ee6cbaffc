// The library's sources once more, in a namespace of their own and for the instruction set of the command line.
// LANE_BITS_FUNCTION names it.
#define LOBEFIT_NO_CLONES
#define LANE_BITS_JOIN_(a, b) a##b
#define LANE_BITS_JOIN(a, b) LANE_BITS_JOIN_(a, b)
#define lobefit LANE_BITS_JOIN(lobefit_, LANE_BITS_FUNCTION)
#include "reference/diffuse/single_kernel.cpp"
#include "reference/diffuse/walk_lanes.cpp"
#include "reference/sample_points.cpp"
#include "reference/visible_normals.cpp"
#include "tests/lane_bits.inc"
