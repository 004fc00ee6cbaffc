// What each tier of a model's parameters buys: Base, Advanced, Full.
#pragma once

#include "fit/fit.h"

namespace lobefit {

struct TierFit {
  Tier tier;
  Fit fit;
  /// Share of the mean square that this tier takes off the one before, over held-out entries where there are any, and
  /// its standard error over blocks of directions. 0 of the first tier.
  double gain = 0.0, gain_error = 0.0;
  bool decided = false;  // the gain is more than two standard errors

  /// "advanced takes 12 ± 3 % off base's mean square (held out)"; says so where the data can't tell the two apart.
  std::string verdict(Tier before) const;
};

/// Fits each tier up to `highest` of the options' free parameters. A tier also starts from the one before, so that none
/// ends worse; tiers without parameters of their own are left out.
std::vector<TierFit> fit_tiers(const Model& model, const ParameterValues& values, const Table& table,
                               const FitOptions& options, Tier highest, Monitor& monitor);

Json tiers_json(const std::vector<TierFit>& tiers);

}  // namespace lobefit
