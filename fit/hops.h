// From one valley to the next: what steps downhill don't find.
//
// A model's lobes stand in for one another. A falloff near 1 makes its intensity a second albedo, a second specular
// lobe as wide as can be no longer feels its scale, and a coloured terminator can't change its sign: a fit that gets
// there stays, with a lobe in another one's part. So lobes start anew while the others stay where they are.
#pragma once

#include <functional>

#include "fit/table_problem.h"

namespace lobefit {

/// The parameters that belong to one lobe, by the common beginning of their names: "terminator", "terminator_tint",
/// "terminator_length". Parameters on their own are left out.
std::vector<std::vector<std::string>> lobes_of(const ParameterValues& values);

/// Downhill from a start; called by several threads at once.
using Descend = std::function<Minimum(std::vector<double> start)>;

/// The lowest minimum that is found from `best`: every lobe of which something is free starts anew from several places,
/// then every pair of lobes, and the best of all is taken, until none gains.
Minimum hop(const FitVariables& variables, const ParameterValues& values, Minimum best, std::uint64_t seed,
            const Descend& descend);

}  // namespace lobefit
