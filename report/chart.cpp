#include "report/chart.h"

#include <cmath>

#include "report/figure_layout.h"

namespace lobefit {

using namespace figure_layout;

namespace {

std::size_t chart_columns(std::size_t panels) { return panels <= 3 ? panels : panels == 4 ? 2 : panels <= 9 ? 3 : 4; }

/// Legend entries in columns as wide as the longest: `sample` draws the entry's sign at screen (across, down).
template <class Sample>
std::string legend(const std::vector<std::string>& labels, Sample&& sample) {
  std::size_t longest = 0;
  for (const std::string& label : labels) longest = std::max(longest, length(label));
  std::string text = fmt::format(
      "legend_columns = int((figure_width - 32) / {0:.0f})\n"
      "if (legend_columns < 1) legend_columns = 1\n"
      "if (legend_columns > {1}) legend_columns = {1}\n"
      "legend_lines = ({1} + legend_columns - 1) / legend_columns\n"
      "legend_columns = ({1} + legend_lines - 1) / legend_lines\n"
      "legend_across(entry) = across(16 + {0:.0f} * (entry % legend_columns))\n"
      "legend_down(entry) = down(72 + 20 * (entry / legend_columns))\n",
      62.0 + character_width * label_size * static_cast<double>(longest), labels.size());
  for (std::size_t i = 0; i < labels.size(); ++i) {
    text += fmt::format(
        "set label {0} ''.shortened({1}, figure_width - 74) at screen legend_across({2}) + across(42), "
        "legend_down({2}) left noenhanced\n",
        101 + i, literal(labels[i]), i);
    text += sample(i);
  }
  return text;
}

std::string panel_title(const std::string& title) {
  return fmt::format(
      "panel_title = {}\n"
      "set title ''.shortened(panel_title, panel_width) noenhanced offset 0, -0.6 "
      "font ''.plain(fitting(panel_title, {}, panel_width))\n",
      literal(title), label_size);
}

FigureSize panel_size(std::size_t panels, int column_width) {
  const std::size_t columns = chart_columns(panels), lines = (panels + columns - 1) / columns;
  return {std::max(1000, static_cast<int>(columns) * column_width), 190 + static_cast<int>(lines) * 250};
}

}  // namespace

std::string chart_figure(const std::vector<ChartPanel>& panels, const std::vector<std::string>& labels,
                         const std::string& title, const std::string& subtitle, const std::string& horizontal,
                         const ChartRange& range) {
  const std::size_t columns = chart_columns(panels.size()), lines = (panels.size() + columns - 1) / columns;
  std::string text = header(title, subtitle);
  for (std::size_t panel = 0; panel < panels.size(); ++panel) {
    for (std::size_t s = 0; s < labels.size(); ++s) {
      const ChartSeries& series = panels[panel].series[s];
      for (const bool hollow : {false, true}) {
        text += fmt::format("${}_{}_{} << EOD\n", hollow ? "hollow" : "full", panel + 1, s + 1);
        for (const ChartPoint& point : series.points) {
          if (point.hollow == hollow)
            text += fmt::format("{:.6g} {:.8g} {:.4g}\n", point.x, point.y, point.half_interval);
        }
        text += "EOD\n";
      }
      text += fmt::format("$line_{}_{} << EOD\n", panel + 1, s + 1);
      for (const auto& [x, y] : series.line) text += fmt::format("{:.6g} {:.8g}\n", x, y);
      text += "EOD\n";
    }
  }
  text += legend(labels, [&](std::size_t s) {
    const LineStyle& style = line_styles[s % line_styles.size()];
    return fmt::format(
        "set linetype {0} linecolor rgb '{1}' linewidth 1.8 dashtype {2}\n"
        "set style line {3} linecolor rgb '{1}' linewidth 1.2 dashtype solid pointtype 7 pointsize 0.7\n"
        "set style line {4} linecolor rgb '{1}' linewidth 1.2 dashtype solid pointtype 6 pointsize 0.9\n"
        "set arrow {5} from screen legend_across({6}), legend_down({6}) "
        "to screen legend_across({6}) + across(34), legend_down({6}) nohead linetype {0}\n"
        "set label {7} '' at screen legend_across({6}) + across(17), legend_down({6}) point linestyle {3}\n",
        s + 1, style.colour, style.dashes, 201 + s, 301 + s, 101 + s, s, 401 + s);
  });
  text +=
      "left = 66.0; right = figure_width - 20.0; top = 94.0 + 20.0 * legend_lines; bottom = figure_height - 50.0\n"
      "gap_across = 62.0; gap_down = 40.0\n";
  text += panel_layout(columns, lines) + shared_axis_labels(horizontal, "");
  text += "set grid linetype 1 linewidth 0.5 linecolor rgb '#e4e4e4' dashtype solid\n";
  text += fmt::format("set xrange [{:g}:{:g}]; set xtics {:g}\n", range.left, range.right, range.tick);
  text += "unset key\nset multiplot\n";
  for (std::size_t panel = 0; panel < panels.size(); ++panel) {
    const ChartPanel& own = panels[panel];
    text += panel_margins(panel % columns, panel / columns) + panel_title(own.title);
    text += fmt::format("set yrange [{:.6g}:{:.6g}]; set ytics {:g}\n", own.lower, own.upper,
                        tick_step(own.upper - own.lower, 5));
    text += panel + columns >= panels.size() ? "set format x '%g'\n" : "set format x ''\n";
    text += "plot";
    // A datablock without data is an error for gnuplot.
    std::string plots;
    for (std::size_t s = 0; s < labels.size(); ++s) {
      const ChartSeries& series = own.series[s];
      const auto add = [&](const std::string& plot) { plots += (plots.empty() ? " " : ", \\\n    ") + plot; };
      if (!series.line.empty()) add(fmt::format("$line_{}_{} with lines linetype {}", panel + 1, s + 1, s + 1));
      for (const bool hollow : {false, true}) {
        if (std::ranges::none_of(series.points, [&](const ChartPoint& point) { return point.hollow == hollow; })) {
          continue;
        }
        const std::string block = fmt::format("${}_{}_{}", hollow ? "hollow" : "full", panel + 1, s + 1);
        const std::size_t style = (hollow ? 301 : 201) + s;
        add(fmt::format("{} using 1:($2-$3):(0):(2*$3) with vectors nohead linestyle {}", block, style));
        add(fmt::format("{} using 1:2 with points linestyle {}", block, style));
      }
    }
    text += (plots.empty() ? " 1/0" : plots) + "\n";
    if (panel == 0) text += "unset label; unset arrow\n";
  }
  return text + "unset multiplot\n";
}

FigureSize chart_figure_size(const std::vector<ChartPanel>& panels) { return panel_size(panels.size(), 380); }

std::string bar_figure(const std::vector<BarPanel>& panels, const std::vector<std::string>& labels,
                       const std::string& title, const std::string& subtitle, const std::string& vertical) {
  const std::size_t columns = chart_columns(panels.size()), lines = (panels.size() + columns - 1) / columns;
  const double slot = static_cast<double>(labels.size()) + 1.0;
  double highest = 0.0;
  std::string text = header(title, subtitle);
  for (std::size_t panel = 0; panel < panels.size(); ++panel) {
    for (std::size_t s = 0; s < labels.size(); ++s) {
      text += fmt::format("$bars_{}_{} << EOD\n", panel + 1, s + 1);
      for (std::size_t g = 0; g < panels[panel].groups.size(); ++g) {
        const BarGroup& group = panels[panel].groups[g];
        const double x = slot * static_cast<double>(g) + static_cast<double>(s);
        const double tick = s < group.ticks.size() ? group.ticks[s] : group.bars[s];
        text += fmt::format("{:g} {:.6g} {:.6g}\n", x, group.bars[s], tick);
        highest = std::max({highest, group.bars[s], tick});
      }
      text += "EOD\n";
    }
  }
  text += legend(labels, [&](std::size_t s) {
    return fmt::format(
        "set object {0} rectangle from screen legend_across({1}) + across(18), legend_down({1}) - 6.0 / figure_height "
        "to screen legend_across({1}) + across(34), legend_down({1}) + 6.0 / figure_height "
        "fillcolor rgb '{2}' fillstyle solid noborder\n",
        s + 1, s, line_styles[s % line_styles.size()].colour);
  });
  text +=
      "left = 76.0; right = figure_width - 20.0; top = 94.0 + 20.0 * legend_lines; bottom = figure_height - 36.0\n"
      "gap_across = 30.0; gap_down = 56.0\n";
  text += panel_layout(columns, lines) + shared_axis_labels("", vertical);
  text += fmt::format(
      "set grid ytics linetype 1 linewidth 0.5 linecolor rgb '#e4e4e4' dashtype solid\n"
      "set yrange [0:{:.6g}]; set ytics {:g}; set boxwidth 0.9; set style fill solid noborder\n"
      "unset key\nset multiplot\n",
      1.05 * highest, tick_step(highest, 6));
  for (std::size_t panel = 0; panel < panels.size(); ++panel) {
    const BarPanel& own = panels[panel];
    text += panel_margins(panel % columns, panel / columns) + panel_title(own.title);
    text +=
        fmt::format("set xrange [-1:{:g}]\nset xtics scale 0 (", slot * static_cast<double>(own.groups.size()) - 1.0);
    for (std::size_t g = 0; g < own.groups.size(); ++g) {
      text += fmt::format("{}{} {:g}", g == 0 ? "" : ", ", literal(own.groups[g].title),
                          slot * static_cast<double>(g) + 0.5 * static_cast<double>(labels.size() - 1));
    }
    text += ")\n";
    text += panel % columns == 0 ? "set format y '%g'\n" : "set format y ''\n";
    text += "plot";
    for (std::size_t s = 0; s < labels.size(); ++s) {
      text += fmt::format(
          "{0} $bars_{1}_{2} using 1:2 with boxes linecolor rgb '{3}', \\\n    $bars_{1}_{2} using "
          "($1-0.45):3:(0.9):(0) with vectors nohead linecolor rgb '#000000' linewidth 2",
          s == 0 ? "" : ", \\\n   ", panel + 1, s + 1, line_styles[s % line_styles.size()].colour);
    }
    text += "\n";
    if (panel == 0) {
      text += "unset label; unset arrow\n";
      for (std::size_t s = 0; s < labels.size(); ++s) text += fmt::format("unset object {}\n", s + 1);
    }
  }
  return text + "unset multiplot\n";
}

FigureSize bar_figure_size(const std::vector<BarPanel>& panels) { return panel_size(panels.size(), 380); }

}  // namespace lobefit
