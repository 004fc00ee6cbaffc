#define LANE_BITS_FUNCTION shipped
#include "tests/lane_bits.inc"
