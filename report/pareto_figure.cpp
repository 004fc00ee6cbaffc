#include "report/pareto_figure.h"

#include <numeric>

#include "report/figure_layout.h"

namespace lobefit {

using namespace figure_layout;

namespace {

constexpr double left = 66.0, right_margin = 24.0, top = 92.0, bottom_margin = 50.0, gap = 30.0;

/// In pixels of a panel, from its top left.
struct Box {
  double left, top, right, bottom;

  bool meets(const Box& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
};

/// A label's place about its point.
struct Place {
  const char* justified;
  double across, down;  // of its anchor, from the point
};
constexpr std::array places{Place{"left", 8, 0},     Place{"right", -8, 0},  Place{"center", 0, -13},
                            Place{"center", 0, 13},  Place{"left", 8, -12},  Place{"left", 8, 12},
                            Place{"right", -8, -12}, Place{"right", -8, 12}, Place{"left", 8, 22}};

Box box_of(const Place& place, double x, double y, double width) {
  const std::string_view justified = place.justified;
  const double middle = x + place.across, begin = justified == "left"    ? middle
                                                  : justified == "right" ? middle - width
                                                                         : middle - 0.5 * width;
  return {begin, y + place.down - 7.0, begin + width, y + place.down + 7.0};
}

}  // namespace

std::vector<std::size_t> pareto_front(const std::vector<ParetoPoint>& points) {
  std::vector<std::size_t> front;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool beaten = std::ranges::any_of(points, [&](const ParetoPoint& other) {
      return other.cost <= points[i].cost && other.error <= points[i].error &&
             (other.cost < points[i].cost || other.error < points[i].error);
    });
    if (!beaten) front.push_back(i);
  }
  std::ranges::stable_sort(front, {}, [&](std::size_t i) { return points[i].cost; });
  return front;
}

std::string pareto_figure(const std::vector<ParetoPanel>& panels, const std::string& title, const std::string& subtitle,
                          const std::string& horizontal, const std::string& vertical, FigureSize size) {
  double dearest = 0.0, worst = 0.0;
  for (const ParetoPanel& panel : panels) {
    for (const ParetoPoint& point : panel.points) {
      dearest = std::max(dearest, point.cost);
      worst = std::max(worst, point.error);
    }
  }
  dearest *= 1.12, worst *= 1.06;
  const double columns = static_cast<double>(panels.size());
  const double panel_width = (size.width - left - right_margin - (columns - 1.0) * gap) / columns;
  const double panel_height = size.height - top - bottom_margin;

  std::string text = header(title, subtitle);
  text += fmt::format(
      "left = {}; right = figure_width - {}; top = {}; bottom = figure_height - {}; gap_across = {}; gap_down = 0.0\n",
      left, right_margin, top, bottom_margin, gap);
  text += panel_layout(panels.size(), 1) + shared_axis_labels(horizontal, vertical);
  text += fmt::format(
      "set grid linetype 1 linewidth 0.5 linecolor rgb '#e4e4e4' dashtype solid\n"
      "set xrange [0:{:.6g}]; set xtics {:g}\nset yrange [0:{:.6g}]; set ytics {:g}\n"
      "unset key\n",
      dearest, tick_step(dearest, 6), worst, tick_step(worst, 6));
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const std::vector<ParetoPoint>& points = panels[p].points;
    text += fmt::format("$points_{} << EOD\n", p + 1);
    for (const ParetoPoint& point : points) text += fmt::format("{:.6g} {:.8g}\n", point.cost, point.error);
    text += fmt::format("EOD\n$front_{} << EOD\n", p + 1);
    const std::vector<std::size_t> front = pareto_front(points);
    for (const std::size_t i : front) text += fmt::format("{:.6g} {:.8g}\n", points[i].cost, points[i].error);
    text += "EOD\n";
  }
  text += "set multiplot\n";
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const std::vector<ParetoPoint>& points = panels[p].points;
    const std::vector<std::size_t> front = pareto_front(points);
    text += panel_margins(p, 0);
    text +=
        fmt::format("set title {} noenhanced offset 0, -0.6 font ''.plain({})\n", literal(panels[p].title), label_size);
    if (p > 0) text += "unset label\nset format y ''\n";
    const auto across_panel = [&](const ParetoPoint& point) { return panel_width * point.cost / dearest; };
    const auto down_panel = [&](const ParetoPoint& point) { return panel_height * (1.0 - point.error / worst); };
    std::vector<Box> taken;
    for (const ParetoPoint& point : points) {
      const double x = across_panel(point), y = down_panel(point);
      taken.push_back({x - 5.0, y - 5.0, x + 5.0, y + 5.0});
    }
    std::vector<Box> line;  // the front, in small pieces
    for (std::size_t f = 1; f < front.size(); ++f) {
      const ParetoPoint &from = points[front[f - 1]], &to = points[front[f]];
      constexpr int pieces = 100;
      for (int piece = 0; piece <= pieces; ++piece) {
        const double x = std::lerp(across_panel(from), across_panel(to), piece / double{pieces});
        const double y = std::lerp(down_panel(from), down_panel(to), piece / double{pieces});
        line.push_back({x - 2.0, y - 2.0, x + 2.0, y + 2.0});
      }
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double x = across_panel(points[i]), y = down_panel(points[i]);
      const double width = character_width * label_size * static_cast<double>(length(points[i].label));
      const auto is_free = [&](const Place& place, bool over_line) {
        const Box box = box_of(place, x, y, width);
        return box.left >= 2.0 && box.right <= panel_width + 12.0 && box.top >= 0.0 && box.bottom <= panel_height &&
               std::ranges::none_of(taken, [&](const Box& other) { return box.meets(other); }) &&
               (over_line || std::ranges::none_of(line, [&](const Box& other) { return box.meets(other); }));
      };
      auto found = std::ranges::find_if(places, [&](const Place& place) { return is_free(place, false); });
      if (found == places.end()) {
        found = std::ranges::find_if(places, [&](const Place& place) { return is_free(place, true); });
      }
      const Place& place = found == places.end() ? places[0] : *found;
      taken.push_back(box_of(place, x, y, width));
      const bool best = std::ranges::find(front, i) != front.end();
      text += fmt::format(
          "set label {} {} at first {:.6g}, {:.8g} {} offset screen {:.1f} / figure_width, {:.1f} / figure_height "
          "noenhanced textcolor rgb '{}' font ''.plain({})\n",
          100 + i, literal(points[i].label), points[i].cost, points[i].error, place.justified, place.across,
          -place.down, best ? "#000000" : "#555555", label_size);
    }
    text += fmt::format(
        "plot $front_{0} with lines linecolor rgb '{1}' linewidth 1.5 dashtype (6,4), \\\n"
        "    $points_{0} with points pointtype 7 pointsize 0.8 linecolor rgb '#777777', \\\n"
        "    $front_{0} with points pointtype 7 pointsize 1.0 linecolor rgb '{1}'\n",
        p + 1, line_styles[0].colour);
  }
  return text + "unset multiplot\n";
}

}  // namespace lobefit
