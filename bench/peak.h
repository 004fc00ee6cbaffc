// What the core itself can do, measured in the same run as what is held against it.
#pragma once

#include <cstdint>

namespace lobefit {

/// `count` additions that wait for one another, one clock cycle each.
std::uint64_t dependent_additions(std::uint64_t count);
/// `count` rounds of independent float multiply-adds; returns a value that depends on all of them.
float multiply_adds(std::uint64_t count);
/// Floating-point operations of one round: two per multiply-add.
std::uint64_t operations_per_round();
/// Lanes of the widest vector × 2 ports × 2 operations.
int peak_operations_per_cycle();

}  // namespace lobefit
