// lobefit plot pareto: cost against error of the rough diffuse forms.
#pragma once

#include "cli/arguments.h"

namespace lobefit {

void add_plot_pareto(CLI::App& plot, Context& context);

}  // namespace lobefit
