#pragma once

#include <string>

#include "fit/tiers.h"

namespace lobefit {

/// A fit for people: parameters with intervals, metrics, remarks.
std::string fit_text(const Fit& fit);
/// "-0.55101 [-0.55102, -0.55101]", or why there is no interval.
std::string interval_text(const FitParameter& parameter);
/// What each tier buys; empty for no tiers.
std::string tiers_text(const std::vector<TierFit>& tiers);

}  // namespace lobefit
