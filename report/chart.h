// Charts of numbers against a number, and of numbers side by side, drawn by gnuplot: programs for write_figure().
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "report/figure.h"

namespace lobefit {

struct ChartPoint {
  double x, y;
  double half_interval = 0.0;
  bool hollow = false;
};

/// Points, with intervals, and a line of its own.
struct ChartSeries {
  std::vector<ChartPoint> points;
  std::vector<std::pair<double, double>> line;
};

struct ChartPanel {
  std::string title;
  std::vector<ChartSeries> series;  // as many as there are labels
  double lower, upper;              // of the vertical axis; what lies beyond is cut off
};

/// Where the shared horizontal axis begins and ends, and its ticks.
struct ChartRange {
  double left = 0.0, right = 1.02, tick = 0.25;
};

/// A panel per quantity on a shared horizontal axis.
std::string chart_figure(const std::vector<ChartPanel>& panels, const std::vector<std::string>& labels,
                         const std::string& title, const std::string& subtitle, const std::string& horizontal,
                         const ChartRange& range = {});
FigureSize chart_figure_size(const std::vector<ChartPanel>& panels);

struct BarGroup {
  std::string title;
  std::vector<double> bars;   // as many as there are labels
  std::vector<double> ticks;  // a black tick across each bar
};

struct BarPanel {
  std::string title;
  std::vector<BarGroup> groups;
};

/// Groups of bars on one scale that starts at 0.
std::string bar_figure(const std::vector<BarPanel>& panels, const std::vector<std::string>& labels,
                       const std::string& title, const std::string& subtitle, const std::string& vertical);
FigureSize bar_figure_size(const std::vector<BarPanel>& panels);

}  // namespace lobefit
