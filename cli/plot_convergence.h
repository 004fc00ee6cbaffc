// lobefit plot convergence: the steps of fits.
#pragma once

#include "cli/arguments.h"

namespace lobefit {

void add_plot_convergence(CLI::App& plot, Context& context);

}  // namespace lobefit
