#pragma once

#include <string>

#include "fit/fit.h"

namespace lobefit {

/// A fit for people: parameters with intervals, metrics, remarks.
std::string fit_text(const Fit& fit);

}  // namespace lobefit
