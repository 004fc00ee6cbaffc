// A fit as people ask for it: settings by name, of which those left out suit the table.
//
//   const FitTable taken = fit_table(read_brdf_file("aurora_white_rgb.bsdf"), "auto", "");
//   const TableFit result = fit_as_set({.model = &find_model("callisto")}, taken, 1, monitor);
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fit/tiers.h"
#include "reference/formats/brdf_file.h"

namespace lobefit {

/// Empty texts and absent values mean: as suits the table.
struct FitSettings {
  const Model* model = nullptr;
  std::string tier = "full", metric = "log", weights, loss = "none", grid = "auto", intervals;
  std::vector<std::string> free, fix, bounds, mappings;  // NAME[=VALUE], NAME=LOWER,UPPER, NAME=SCALE*AXIS^POWER
  std::optional<int> starts;
  std::optional<std::size_t> directions;
  double holdout = 0.0, prior = 0.05;
  int lobes = 2;
  bool staged = false, not_staged = false, compare_tiers = false, hops = false;
};

/// A file as a fit takes it.
struct FitTable {
  BrdfFile file;     // its table on the grid
  std::string grid;  // "native" or a grid's name
  std::vector<WeightFactor> weights;
  bool dense = false;  // a dense isotropic measurement
};

/// `grid` and `weights` as in FitSettings: "auto" and "" are as suits the file.
FitTable fit_table(BrdfFile file, const std::string& grid, const std::string& weights);

struct TableFit {
  Fit fit;
  std::vector<TierFit> tiers;  // empty unless they were compared
};

/// Dense measured files are fitted stage by stage from several starts, and have intervals by blocks of directions;
/// settings come before that. Parameters that the table's reference states keep those values unless freed by name.
/// Throws Error(usage) for settings that can't be.
TableFit fit_as_set(const FitSettings& settings, const FitTable& taken, std::uint64_t seed, Monitor& monitor);

}  // namespace lobefit
