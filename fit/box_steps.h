// Levenberg and Marquardt's steps inside a box, on normal equations.
//
// Ceres projects a step that leaves the bounds; where half of thirty variables press on theirs, as tints and falloffs
// of measured materials do, its projected steps gain little and it takes that for convergence. Here each step is the
// minimum of the damped quadratic model over the box itself.
#pragma once

#include "fit/least_squares.h"

namespace lobefit {

/// The minimum of a problem that has `condense`, by at most maximum_iterations steps; converged when neither the model
/// nor the step taken gains more than `tolerance` of the sum of squares. Throws Interrupted if the monitor asks.
Minimum minimise_in_box(const LeastSquaresProblem& problem, Monitor& monitor);

}  // namespace lobefit
