// Models held against a reference's table beside the one that is fitted: as they are, or with parameters of their own
// refitted.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "fit/fit.h"

namespace lobefit {

struct Rival {
  std::string label;
  std::string model;
  std::vector<std::pair<std::string, std::vector<double>>> set = {};
  std::vector<AxisMapping> mappings = {};
  std::vector<std::string> free_per_row = {};  // refitted in each parameter row
  std::vector<std::string> free = {};          // refitted over all rows at once; excludes the other
  /// Where fits per row begin too, beside the values as they are set and the row before: the best end counts.
  std::vector<std::vector<std::pair<std::string, double>>> starts = {};
  double tolerance = 1e-15;  // of refits, see FitOptions
};

struct RivalScore {
  std::string label;
  double rms;
  std::vector<float> values;  // the rival over the table
};

/// The rms of `quantity` over the table, with these weights; refits minimise it.
RivalScore score(const Rival& rival, const Table& table, Quantity quantity, const std::vector<WeightFactor>& weights,
                 Monitor& monitor);

}  // namespace lobefit
