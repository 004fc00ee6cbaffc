// One fit as the command line asks for it: from a file to a result.
#pragma once

#include <string>
#include <vector>

#include "cli/arguments.h"
#include "fit/fit_settings.h"
#include "report/metrics_report.h"

namespace lobefit {

/// What `lobefit fit` was told.
struct FitJobSettings : FitSettings {
  int sphere = 64;  // pixels across the spheres of the metrics report
  bool figure = false;
};

/// A material: a file, or one of several in a file.
struct FitSource {
  std::string path, material;  // material: empty if the file has one

  /// The file's name without extension, or the material's.
  std::string name() const;
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

/// Reads, fits, and describes: see fit_as_set(). Measured files go on the grid that published scores use.
FitJob run_fit(const FitJobSettings& settings, const FitSource& source, const Context& context, Monitor& monitor);

}  // namespace lobefit
