// One fit as the command line asks for it: from a file to a result.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "fit/tiers.h"
#include "report/metrics_report.h"

namespace lobefit {

/// What `lobefit fit` was told. Empty texts and absent values mean: as suits the table.
struct FitSettings {
  const Model* model = nullptr;
  std::string tier = "full", metric = "log", weights, loss = "none", grid = "auto", intervals;
  std::vector<std::string> free, fix, bounds, mappings;
  std::optional<int> starts;
  std::optional<std::size_t> directions;
  double holdout = 0.0, prior = 0.05;
  int lobes = 2;
  int sphere = 64;  // pixels across the spheres of the metrics report
  bool staged = false, not_staged = false, compare_tiers = false, figure = false, hops = false;
};

/// A material: a file, or one of several in a file.
struct FitSource {
  std::string path, material;  // material: empty if the file has one

  /// The file's name without extension, or the material's.
  std::string name() const;
};

/// A file as a fit takes it.
struct FitTable {
  BrdfFile file;     // its table on the grid
  std::string grid;  // "native" or a grid's name
  std::vector<WeightFactor> weights;
  bool dense = false;  // a dense isotropic measurement
};

/// `grid` and `weights` as in FitSettings: "auto" and "" are as suits the file.
FitTable read_fit_table(const FitSource& source, const std::string& grid, const std::string& weights);

/// How a fit took its table, by its JSON file; what the file doesn't say is left to suit the table.
struct FitProvenance {
  std::string grid = "auto", weights, metric = "log", material, table, table_sha256;  // table: its path
};
/// Throws Error(invalid_input).
FitProvenance fit_provenance(const std::string& path);

struct FitJob {
  Fit fit;
  std::vector<TierFit> tiers;  // empty unless they were compared
  std::string grid;            // "native" or a grid's name
  MetricsReport report;
  std::string figure;  // a gnuplot program, if the settings ask for one
  Json document;
};

/// Reads, fits, and describes. Measured files go on the grid that published scores use, are fitted stage by stage from
/// several starts, and have intervals by blocks of directions; settings come before that.
FitJob run_fit(const FitSettings& settings, const FitSource& source, const Context& context, Monitor& monitor);

}  // namespace lobefit
