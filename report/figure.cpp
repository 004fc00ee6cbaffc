#include "report/figure.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "models/error.h"
#include "models/scalar.h"
#include "reference/estimate.h"
#include "report/figure_layout.h"

namespace lobefit {

using namespace figure_layout;

namespace {

/// Two-sided 95 % quantile of Student's t with replicate_count - 1 degrees of freedom.
constexpr double t_quantile = 2.04;
static_assert(replicate_count == 32);

constexpr std::size_t most_default_rows = 6;

// ---- Tables ---------------------------------------------------------------------------------------------------

/// A place in the grid of any table with the reference's axes.
struct Place {
  std::size_t row, theta_o, theta_i, phi;

  std::size_t entry(const Table& table) const {
    return theta_i * table.grid.phi.size() + phi + (row * table.lines_per_parameter() + theta_o) * table.width();
  }
};

/// π f cos θi. Channels share their samples, so their errors are averaged like their values.
struct Shown {
  double value, standard_error;
};

/// Nothing where the table has no number to show.
std::optional<Shown> shown(const Table& table, const Place& place) {
  const std::size_t entry = place.entry(table);
  if (!table.valid[entry]) return std::nullopt;
  const double scale = pi * std::cos(radians(table.grid.theta_i.values[place.theta_i])) / table.channels;
  Shown result{0.0, 0.0};
  for (int c = 0; c < table.channels; ++c) {
    result.value += scale * static_cast<double>(table.value(entry, c));
    result.standard_error += scale * static_cast<double>(table.standard_error(entry, c));
  }
  if (!std::isfinite(result.value)) return std::nullopt;
  if (!std::isfinite(result.standard_error)) result.standard_error = 0.0;
  return result;
}

std::vector<std::size_t> chosen_rows(const Table& table, const SliceChoice& choice) {
  if (!choice.parameter_rows.empty()) return choice.parameter_rows;
  const std::size_t all = table.parameter_rows(), count = std::min(all, most_default_rows);
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < count; ++i) {
    rows.push_back(count == 1 ? 0 : (2 * i * (all - 1) + count - 1) / (2 * (count - 1)));
  }
  return rows;
}

void require_inside(std::size_t index, std::size_t size, const char* axis) {
  if (index < size) return;
  throw Error(ExitCode::usage, fmt::format("no {} number {}", axis, index), "figure",
              fmt::format("the table has numbers 0 to {}", size - 1));
}

bool same_angles(const Axis& a, const Axis& b) { return a.values == b.values; }

void require_consistent(const Table& reference, const std::vector<LabelledTable>& models, const SliceChoice& choice) {
  require_inside(choice.theta_o, reference.grid.theta_o.size(), "theta_o");
  require_inside(choice.phi, reference.grid.phi.size(), "phi");
  for (const std::size_t row : choice.parameter_rows) require_inside(row, reference.parameter_rows(), "parameter row");
  for (const auto& [label, table] : models) {
    const Grid &grid = table.grid, &expected = reference.grid;
    if (same_angles(grid.theta_i, expected.theta_i) && same_angles(grid.theta_o, expected.theta_o) &&
        same_angles(grid.phi, expected.phi) &&
        std::equal(table.parameter_axes.begin(), table.parameter_axes.end(), reference.parameter_axes.begin(),
                   reference.parameter_axes.end(), same_angles)) {
      continue;
    }
    throw Error(ExitCode::usage, "'" + label + "' has other axes than the reference", "figure",
                "render both over the same grid and the same parameter axes");
  }
}

/// The azimuth across the normal from `phi`; f is symmetric about the plane of the view.
std::size_t opposite_azimuth(const Axis& axis, std::size_t phi) {
  const double opposite = 180.0 - axis.values[phi];
  const auto found = std::find_if(axis.values.begin(), axis.values.end(),
                                  [&](double value) { return std::abs(value - opposite) < 1e-6; });
  if (found == axis.values.end()) {
    throw Error(ExitCode::usage,
                fmt::format("the table has no azimuth {:.6g} across from {:.6g}", opposite, axis.values[phi]), "figure",
                "show one side, or render a grid with both");
  }
  return static_cast<std::size_t>(found - axis.values.begin());
}

// ---- Text -----------------------------------------------------------------------------------------------------

std::string row_name(const Table& table, std::size_t row) {
  std::string name;
  const std::vector<double> values = table.parameter_values(row);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Axis& axis = table.parameter_axes[i];
    const std::string unit = axis.unit == "degree" ? "°" : axis.unit.empty() ? "" : " " + axis.unit;
    name += fmt::format("{}{} = {:.6g}{}", i == 0 ? "" : ", ", axis.name, values[i], unit);
  }
  return name;
}

/// Two significant digits.
std::string rounded(double value) {
  return value < 10.0 ? fmt::format("{:#.2g}", value) : fmt::format("{:.0f}", value);
}

std::string reference_name(const Table& reference) { return reference.model.empty() ? "reference" : reference.model; }

std::string azimuth_text(double phi) {
  return fmt::format("φ = {:.6g}°{}", phi, phi == 0.0 ? " (retro side)" : phi == 180.0 ? " (mirror side)" : "");
}

// ---- Slices ---------------------------------------------------------------------------------------------------

struct SlicePoint {
  double theta_i;  // negative on the opposite side
  Place place;
};

std::vector<SlicePoint> slice_points(const Table& table, const SliceChoice& choice, std::size_t row) {
  const std::vector<double>& angles = table.grid.theta_i.values;
  std::vector<SlicePoint> points;
  if (choice.both_sides) {
    const std::size_t opposite = opposite_azimuth(table.grid.phi, choice.phi);
    for (std::size_t i = angles.size(); i-- > 0;) {
      if (angles[i] > 0.0) points.push_back({-angles[i], {row, choice.theta_o, i, opposite}});
    }
  }
  for (std::size_t i = 0; i < angles.size(); ++i) points.push_back({angles[i], {row, choice.theta_o, i, choice.phi}});
  return points;
}

/// A datablock of θi, value and half of its 95 % interval. A blank line stands for an entry that is left out, so that
/// no line is drawn across it.
std::string slice_data(const std::string& name, const Table& table, const std::vector<SlicePoint>& points) {
  std::string text = "$" + name + " << EOD\n";
  bool in_gap = true;
  for (const SlicePoint& point : points) {
    const std::optional<Shown> entry = shown(table, point.place);
    if (entry) {
      text += fmt::format("{:.6g} {:.8g} {:.4g}\n", point.theta_i, entry->value, t_quantile * entry->standard_error);
    } else if (!in_gap) {
      text += "\n";
    }
    in_gap = !entry;
  }
  return text + "EOD\n";
}

std::string legend_entry(std::size_t index, const std::string& label) {
  return fmt::format(
      "set label {0} ''.shortened({1}, figure_width - 74) at screen legend_across({2}) + across(42), legend_down({2}) "
      "left noenhanced\n",
      101 + index, literal(label), index);
}

struct Range {
  double lower = 0.0, upper = 0.0;

  void include(double value) {
    lower = std::min(lower, value);
    upper = std::max(upper, value);
  }
};

std::size_t slice_columns(std::size_t panels) {
  return panels <= 3 ? panels : static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(panels))));
}

}  // namespace

std::string slice_figure(const Table& reference, const std::vector<LabelledTable>& models, const SliceChoice& choice,
                         const std::string& title) {
  require_consistent(reference, models, choice);
  const std::vector<std::size_t> rows = chosen_rows(reference, choice);
  const std::size_t columns = slice_columns(rows.size()), lines = (rows.size() + columns - 1) / columns;

  const double theta_o = reference.grid.theta_o.values[choice.theta_o], phi = reference.grid.phi.values[choice.phi];
  std::string subtitle = theta_o == 0.0 ? "view along the normal" : fmt::format("view at θ_o = {:.6g}°", theta_o);
  if (choice.both_sides && phi == 0.0) {
    subtitle += theta_o == 0.0 ? "" : ", on the side of positive θ_i";
  } else if (choice.both_sides) {
    subtitle += fmt::format(", light at φ = {:.6g}°, and across from it at negative θ_i", phi);
  } else if (theta_o != 0.0) {
    subtitle += ", light at " + azimuth_text(phi);
  }

  // Data, and the range that the panels share. A model that leaves the reference far behind is cut off, not followed.
  std::string data;
  Range reference_range, models_range;
  bool has_errors = false;
  for (std::size_t panel = 0; panel < rows.size(); ++panel) {
    const std::vector<SlicePoint> points = slice_points(reference, choice, rows[panel]);
    data += slice_data(fmt::format("reference_{}", panel + 1), reference, points);
    for (std::size_t m = 0; m < models.size(); ++m) {
      data += slice_data(fmt::format("model_{}_{}", m + 1, panel + 1), models[m].table, points);
    }
    for (const SlicePoint& point : points) {
      if (const auto entry = shown(reference, point.place)) {
        const double half = t_quantile * entry->standard_error;
        has_errors |= half > 0.0;
        reference_range.include(entry->value - half);
        reference_range.include(entry->value + half);
      }
      for (const LabelledTable& model : models) {
        if (const auto entry = shown(model.table, point.place)) models_range.include(entry->value);
      }
    }
  }
  const double reference_span = reference_range.upper - reference_range.lower;
  const double slack = reference_span > 0.0 ? 0.5 * reference_span : 1e300;
  double upper = std::max(reference_range.upper, std::min(models_range.upper, reference_range.upper + slack));
  double lower = std::min(reference_range.lower, std::max(models_range.lower, reference_range.lower - slack));
  if (!(upper > lower)) upper = lower + 1.0;
  upper += 0.04 * (upper - lower);
  if (lower < 0.0) lower -= 0.04 * (upper - lower);

  // Legend entries in columns as wide as the longest, on as many lines as the figure's width asks for.
  const std::string reference_label = reference_name(reference) + (has_errors ? " ± 95 %" : "");
  std::size_t longest = length(reference_label);
  for (const LabelledTable& model : models) longest = std::max(longest, length(model.label));
  const double entry_width = 62.0 + character_width * label_size * static_cast<double>(longest);

  std::string text = header(title, subtitle);
  text += data;
  text += fmt::format(
      "legend_columns = int((figure_width - 32) / {0:.0f})\n"
      "if (legend_columns < 1) legend_columns = 1\n"
      "if (legend_columns > {1}) legend_columns = {1}\n"
      "legend_lines = ({1} + legend_columns - 1) / legend_columns\n"
      "legend_columns = ({1} + legend_lines - 1) / legend_lines\n"
      "legend_across(entry) = across(16 + {0:.0f} * (entry % legend_columns))\n"
      "legend_down(entry) = down(72 + 20 * (entry / legend_columns))\n"
      "left = 66.0; right = figure_width - 20.0; top = 86.0 + 20.0 * legend_lines; bottom = figure_height - 50.0\n"
      "gap_across = 30.0; gap_down = 34.0\n",
      entry_width, models.size() + 1);
  text += panel_layout(columns, lines);
  text += shared_axis_labels(choice.both_sides ? "signed θ_i (degrees)" : "θ_i (degrees)", "π {/:Italic f} cos θ_i");
  // The reference comes first in the legend, the models follow as they were given.
  text += "set style line 100 linecolor rgb '#000000' linewidth 1 dashtype solid pointtype 7 pointsize 0.5\n";
  text += legend_entry(0, reference_label);
  text += "set label 100 '' at screen legend_across(0) + across(17), legend_down(0) point linestyle 100\n";
  if (has_errors) {
    text +=
        "set arrow 100 from screen legend_across(0) + across(17), legend_down(0) - 6.0 / figure_height "
        "to screen legend_across(0) + across(17), legend_down(0) + 6.0 / figure_height nohead linestyle 100\n";
  }
  for (std::size_t m = 0; m < models.size(); ++m) {
    // Past the last style colours repeat, thinner and with other dashes.
    const std::size_t round = m / line_styles.size();
    text += fmt::format("set linetype {} linecolor rgb '{}' linewidth {} dashtype {}\n", m + 1,
                        line_styles[m % line_styles.size()].colour, round == 0 ? 2.2 : 1.3,
                        line_styles[(m + 3 * round) % line_styles.size()].dashes);
    text += legend_entry(m + 1, models[m].label);
    text += fmt::format(
        "set arrow {0} from screen legend_across({1}), legend_down({1}) "
        "to screen legend_across({1}) + across(34), legend_down({1}) nohead linetype {1}\n",
        101 + m, m + 1);
  }
  const char* ticks = choice.both_sides ? "-60,30,60" : columns > 2 ? "30" : "15";
  text += fmt::format(
      "set grid linetype 1 linewidth 0.5 linecolor rgb '#e4e4e4' dashtype solid\n"
      "set xrange [{}:90]; set xtics {}\n"
      "set yrange [{:.6g}:{:.6g}]; set ytics {:g}\n",
      choice.both_sides ? -90 : 0, ticks, lower, upper, tick_step(upper - lower, lines > 1 ? 6 : 8));
  std::string view_line;
  if (choice.both_sides && phi == 0.0 && theta_o > 0.0) {
    view_line = fmt::format(
        "set arrow 1 from first {0:.6g}, graph 0 to first {0:.6g}, graph 1 nohead linecolor rgb '#999999' "
        "linewidth 1 dashtype (3,3) back\n",
        theta_o);
    text += view_line + fmt::format(
                            "set label 5 'view' at first {:.6g}, graph 1 offset -0.5, -0.6 right font ''.plain({}) "
                            "textcolor rgb '#777777'\n",
                            theta_o, tick_size);
  }
  text += "unset key\nset multiplot\n";
  for (std::size_t panel = 0; panel < rows.size(); ++panel) {
    const std::size_t column = panel % columns, line = panel / columns;
    text += panel_margins(column, line);
    text += fmt::format(
        "panel_title = {}\n"
        "set title ''.shortened(panel_title, panel_width) noenhanced offset 0, -0.6 "
        "font ''.plain(fitting(panel_title, {}, panel_width))\n",
        literal(row_name(reference, rows[panel])), label_size);
    text += column == 0 ? "set format y '%g'\n" : "set format y ''\n";
    text += panel + columns >= rows.size() ? "set format x '%g'\n" : "set format x ''\n";
    text += "plot";
    for (std::size_t m = 0; m < models.size(); ++m) {
      text += fmt::format(" $model_{}_{} using 1:2 with lines linetype {}, \\\n    ", m + 1, panel + 1, m + 1);
    }
    // Bars as strokes of their own: gnuplot's yerrorbars erase what lies around each point.
    if (has_errors) {
      text += fmt::format(" $reference_{} using 1:($2-$3):(0):(2*$3) with vectors nohead linestyle 100, \\\n    ",
                          panel + 1);
    }
    text += fmt::format(" $reference_{} using 1:2 with points linestyle 100\n", panel + 1);
    // Title, legend and shared labels belong to the figure, so they are drawn once.
    if (panel == 0) text += "unset label; unset arrow\n" + view_line;
  }
  return text + "unset multiplot\n";
}

FigureSize slice_figure_size(const Table& reference, const SliceChoice& choice) {
  const std::size_t panels = chosen_rows(reference, choice).size(), columns = slice_columns(panels);
  const auto lines = static_cast<int>((panels + columns - 1) / columns);
  return {1000, 190 + lines * (columns == 1 ? 460 : columns == 2 ? 310 : 250)};
}

// ---- Residual maps ----------------------------------------------------------------------------------------------

namespace {

/// Borders between the cells around an axis' values.
std::vector<double> cell_edges(const Axis& axis) {
  const std::vector<double>& values = axis.values;
  if (values.size() == 1) return {std::max(values[0] - 2.5, 0.0), std::min(values[0] + 2.5, 90.0)};
  std::vector<double> edges{0.0};
  for (std::size_t i = 0; i + 1 < values.size(); ++i) edges.push_back(0.5 * (values[i] + values[i + 1]));
  edges.front() = std::max(0.0, 2.0 * values.front() - edges[1]);
  edges.push_back(std::min(90.0, 2.0 * values.back() - edges.back()));
  return edges;
}

struct Residuals {
  std::string cells;           // lines of left, right, lower, upper border and difference
  std::vector<double> values;  // the differences alone

  double rms() const {
    double squares = 0.0;
    for (const double value : values) squares += value * value;
    return values.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(values.size()));
  }
};

Residuals residuals(const Table& reference, const Table& model, std::size_t row, std::size_t phi) {
  const std::vector<double> edges_i = cell_edges(reference.grid.theta_i), edges_o = cell_edges(reference.grid.theta_o);
  // A cell reaches a little under its next neighbours, which are painted later: no seam shows between them.
  const auto reach = [](const std::vector<double>& edges, std::size_t i) {
    return std::min(edges[i] + 0.004 * (edges.back() - edges.front()), edges.back());
  };
  Residuals result;
  for (std::size_t o = 0; o + 1 < edges_o.size(); ++o) {
    for (std::size_t i = 0; i + 1 < edges_i.size(); ++i) {
      const Place place{row, o, i, phi};
      const std::optional<Shown> truth = shown(reference, place), approximation = shown(model, place);
      if (!truth || !approximation) continue;
      result.values.push_back(approximation->value - truth->value);
      result.cells += fmt::format("{:.6g} {:.6g} {:.6g} {:.6g} {:.6g}\n", edges_i[i], reach(edges_i, i + 1), edges_o[o],
                                  reach(edges_o, o + 1), result.values.back());
    }
  }
  return result;
}

}  // namespace

std::string residual_figure(const Table& reference, const std::vector<LabelledTable>& models, const SliceChoice& choice,
                            const std::string& title) {
  require_consistent(reference, models, choice);
  if (models.empty()) throw Error(ExitCode::usage, "a residual map of no model", "figure", "name at least one model");
  if (reference.grid.theta_o.size() == 1 || reference.grid.theta_i.size() == 1) {
    throw Error(ExitCode::usage, "a residual map needs several theta_i and theta_o, the table has only one", "figure",
                "draw a slice instead, or render a grid such as default");
  }
  const std::vector<std::size_t> rows = chosen_rows(reference, choice);

  std::vector<std::vector<Residuals>> panels(rows.size());
  std::vector<double> magnitudes;
  for (std::size_t line = 0; line < rows.size(); ++line) {
    for (const LabelledTable& model : models) {
      panels[line].push_back(residuals(reference, model.table, rows[line], choice.phi));
      for (const double value : panels[line].back().values) magnitudes.push_back(std::abs(value));
    }
  }
  std::sort(magnitudes.begin(), magnitudes.end());
  // One bad corner should not bleach the rest: the scale ends near the 98th percentile, and says so.
  const double largest = magnitudes.empty() ? 0.0 : magnitudes.back();
  const double limit = round_up(magnitudes.empty() ? 1.0 : magnitudes[(magnitudes.size() - 1) * 98 / 100]);

  std::string subtitle = fmt::format("model minus {}, light at {}", escaped(reference_name(reference)),
                                     azimuth_text(reference.grid.phi.values[choice.phi]));
  if (largest > limit) {
    subtitle += fmt::format("; colours saturate at ±{:g}, the largest difference is {}", limit, rounded(largest));
  }

  std::string text = header(title, subtitle);
  for (std::size_t line = 0; line < rows.size(); ++line) {
    for (std::size_t m = 0; m < models.size(); ++m) {
      text += fmt::format("$residual_{}_{} << EOD\n{}EOD\n", m + 1, line + 1, panels[line][m].cells);
    }
  }
  text +=
      "left = 62.0; right = figure_width - 132.0; top = 104.0; bottom = figure_height - 50.0\n"
      "gap_across = 10.0; gap_down = 24.0\n";
  text += panel_layout(models.size(), rows.size());
  text += shared_axis_labels("θ_i (degrees)", "θ_o (degrees)");
  text += diverging_palette;
  const std::vector<double> edges_i = cell_edges(reference.grid.theta_i), edges_o = cell_edges(reference.grid.theta_o);
  text += fmt::format(
      "set border 15\n"
      "set xrange [{:.6g}:{:.6g}]; set yrange [{:.6g}:{:.6g}]\n"
      "set xtics 0,30,60; set ytics 0,30,60\n"
      "set cbrange [-{:g}:{:g}]; set cbtics {:g}\n"
      "set label 7 'π ({{/:Italic f}}_{{model}} − {{/:Italic f}}_{{reference}}) cos θ_i' "
      "at screen across(right + 114), down((top + bottom) / 2) center rotate by 90\n"
      "set colorbox user origin screen across(right + 40), down(bottom) "
      "size screen across(14), (bottom - top) / figure_height\n"
      "set object 1 rectangle from graph 0, graph 0 to graph 1, graph 1 behind fillcolor rgb '#dddddd' "
      "fillstyle solid noborder\n"
      "set style fill solid 1.0 noborder\n"
      "unset key\n"
      "set multiplot\n",
      edges_i.front(), edges_i.back(), edges_o.front(), edges_o.back(), limit, limit, limit / 2.0);
  for (std::size_t line = 0; line < rows.size(); ++line) {
    for (std::size_t m = 0; m < models.size(); ++m) {
      text += panel_margins(m, line);
      if (line == 0) text += column_title(models[m].label, 26);
      if (m + 1 == models.size() && !reference.parameter_axes.empty()) {
        text += fmt::format(
            "line_title = {}\n"
            "set label 6 ''.shortened(line_title, panel_height + gap_down) at screen across(right + 14), graph 0.5 "
            "center rotate by -90 noenhanced font ''.plain(fitting(line_title, {}, panel_height + gap_down))\n",
            literal(row_name(reference, rows[line])), label_size);
      }
      const Residuals& panel = panels[line][m];
      text += fmt::format("set title '{}' font ''.plain({}) offset 0, -0.9\n",
                          panel.values.empty() ? "masked" : "rms " + rounded(panel.rms()), tick_size);
      text += m == 0 ? "set format y '%g'\n" : "set format y ''\n";
      text += line + 1 == rows.size() ? "set format x '%g'\n" : "set format x ''\n";
      text += fmt::format("plot $residual_{}_{} using (0):(0):1:2:3:4:5 with boxxyerror linecolor palette\n", m + 1,
                          line + 1);
      text += "unset label; unset colorbox\n";
    }
  }
  return text + "unset multiplot\n";
}

FigureSize residual_figure_size(const Table& reference, std::size_t models, const SliceChoice& choice) {
  const int columns = static_cast<int>(std::max<std::size_t>(models, 1));
  const int lines = static_cast<int>(chosen_rows(reference, choice).size());
  const int panel = std::clamp(900 / columns, 120, 300);
  return {194 + columns * panel + (columns - 1) * 10, 154 + lines * panel + (lines - 1) * 24};
}

}  // namespace lobefit
