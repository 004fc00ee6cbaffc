// Points named where they lie, cost across and error up, with the front that no other point beats in both.
#pragma once

#include <string>
#include <vector>

#include "report/figure.h"

namespace lobefit {

struct ParetoPoint {
  std::string label;
  double cost, error;
};

/// Indices of the points that none beats: no other costs as little or less and errs as little or less, one of them
/// less. By cost.
std::vector<std::size_t> pareto_front(const std::vector<ParetoPoint>& points);

struct ParetoPanel {
  std::string title;
  std::vector<ParetoPoint> points;
};

/// Panels side by side on the same axes, both from 0.
std::string pareto_figure(const std::vector<ParetoPanel>& panels, const std::string& title, const std::string& subtitle,
                          const std::string& horizontal, const std::string& vertical, FigureSize size);

}  // namespace lobefit
