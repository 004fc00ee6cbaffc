// Variables that the data leave open although their derivatives don't vanish where the fit ended.
//
// An interval is made of derivatives at one point. It says nothing where it is wider than what the variable may be,
// where the variable loses its effect within it, or where it stands on a lobe that may as well not be there.
#pragma once

#include <span>

#include "fit/table_problem.h"

namespace lobefit {

/// Marks as not identifiable, with a remark in words, of a solution's variables
///   - those whose 95 % interval is wider than their range;
///   - those that have no effect at an end of it, as a second lobe's scale beyond what its roughness can follow;
///   - those whose effect goes out where a parameter takes its neutral value, if that parameter can't be told from it,
///     and the parameter itself: falloffs of a lobe in doubt fit the noise (Davies 1977), at a chance of 1e-6.
/// Intervals come from the solution's covariance; without one (exact data) nothing is marked. `problem` may be one that
/// stands for the whole.
void mark_open_variables(const TableProblem& problem, std::span<const double> x, LeastSquaresSolution& solution);

}  // namespace lobefit
