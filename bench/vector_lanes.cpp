#define LANES_NAMESPACE vector_lanes
#include "bench/lanes.inc"
