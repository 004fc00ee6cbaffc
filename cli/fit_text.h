#pragma once

#include <string>

#include "fit/tiers.h"

namespace lobefit {

/// A fit for people: parameters with intervals, metrics, remarks.
std::string fit_text(const Fit& fit);
/// What each tier buys; empty for no tiers.
std::string tiers_text(const std::vector<TierFit>& tiers);

}  // namespace lobefit
