#include "report/image_slice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "models/error.h"
#include "reference/table.h"
#include "report/figure_layout.h"

namespace lobefit {

using namespace figure_layout;

namespace {

/// log2(π f) of the mean of the channels, [theta_d][theta_h]; NaN where there is none.
std::vector<double> image_slice(const SphereBrdf& brdf, const ImageSliceOptions& options) {
  std::vector<double> values;
  const double step = 90.0 / options.steps;
  for (int d = 0; d < options.steps; ++d) {
    for (int h = 0; h < options.steps; ++h) {
      const HalfDifference pair{radians((h + 0.5) * step), radians((d + 0.5) * step), radians(options.phi_d)};
      const Direction wi = pair.wi(), wo = pair.wo();
      double value = 0.0;
      if (wi.z > 0.0 && wo.z > 0.0) {
        const std::optional<Rgb> f = brdf(wi, wo);
        if (f) value = (f->x + f->y + f->z) / 3.0;
      }
      values.push_back(value > 0.0 ? std::log2(pi * value) : std::numeric_limits<double>::quiet_NaN());
    }
  }
  return values;
}

std::string data_block(const std::string& name, const std::vector<double>& values, int steps) {
  std::string text = "$" + name + " << EOD\n";
  for (std::size_t k = 0; k < values.size(); ++k) {
    text += std::isfinite(values[k]) ? fmt::format("{:.4g}", values[k]) : "NaN";
    text += (k + 1) % static_cast<std::size_t>(steps) == 0 ? "\n" : " ";
  }
  return text + "EOD\n";
}

/// All finite values, sorted.
std::vector<double> finite(const std::vector<std::vector<double>>& slices) {
  std::vector<double> values;
  for (const std::vector<double>& slice : slices) {
    std::copy_if(slice.begin(), slice.end(), std::back_inserter(values), [](double x) { return std::isfinite(x); });
  }
  std::sort(values.begin(), values.end());
  return values;
}

std::string colour_scale(std::size_t line, const std::string& label) {
  return fmt::format(
      "set colorbox user origin screen across(right + 14), down(top + {0} * (panel_height + gap_down) + panel_height) "
      "size screen across(14), panel_height / figure_height\n"
      "set label 7 {1} at screen across(right + 84), down(top + {0} * (panel_height + gap_down) + panel_height / 2) "
      "center rotate by 90\n",
      line, literal(label));
}

}  // namespace

std::string image_slice_figure(const std::vector<LabelledBrdf>& brdfs, const ImageSliceOptions& options,
                               const std::string& title) {
  if (brdfs.empty() || options.steps < 1) {
    throw Error(ExitCode::usage, "an image slice of nothing", "figure", "name a BRDF, and at least one step");
  }
  if (!(options.phi_d >= 0.0 && options.phi_d <= 180.0)) {
    throw Error(ExitCode::usage, fmt::format("phi_d = {} is out of range", options.phi_d), "figure",
                "choose from 0 to 180 degrees");
  }
  std::vector<std::vector<double>> slices, ratios;
  for (const LabelledBrdf& one : brdfs) slices.push_back(image_slice(one.brdf, options));
  if (finite({slices[0]}).empty()) {
    throw Error(ExitCode::usage, "no value above 0", brdfs[0].label, "choose another phi_d or another BRDF");
  }
  for (std::size_t k = 1; k < slices.size(); ++k) {
    ratios.push_back(slices[k]);
    for (std::size_t i = 0; i < slices[0].size(); ++i) ratios.back()[i] -= slices[0][i];
  }
  std::vector<double> magnitudes = finite(ratios);
  for (double& value : magnitudes) value = std::abs(value);
  std::sort(magnitudes.begin(), magnitudes.end());
  // As of residual maps: one bad corner should not bleach the rest.
  const double limit = round_up(magnitudes.empty() ? 1.0 : magnitudes[(magnitudes.size() - 1) * 98 / 100]);

  std::string text =
      header(title, fmt::format("φ_d = {:g}°", options.phi_d) +
                        (!magnitudes.empty() && magnitudes.back() > limit
                             ? fmt::format("; stops saturate at ±{:g}, the largest is {:.3g}", limit, magnitudes.back())
                             : ""));
  for (std::size_t k = 0; k < slices.size(); ++k) {
    text += data_block(fmt::format("slice_{}", k + 1), slices[k], options.steps);
    if (k > 0) text += data_block(fmt::format("ratio_{}", k + 1), ratios[k - 1], options.steps);
  }
  const std::size_t lines = slices.size() > 1 ? 2 : 1;
  text +=
      "left = 62.0; right = figure_width - 112.0; top = 104.0; bottom = figure_height - 50.0\n"
      "gap_across = 10.0; gap_down = 24.0\n";
  text += panel_layout(slices.size(), lines);
  text += shared_axis_labels("θ_h (degrees)", "θ_d (degrees)");
  const std::vector<double> all = finite(slices);
  text += fmt::format(
      "cell = 90.0 / {0}\n"
      "set border 15\nset xrange [0:90]; set yrange [0:90]\nset xtics 0,30,60; set ytics 0,30,60\n"
      "set object 1 rectangle from graph 0, graph 0 to graph 1, graph 1 behind fillcolor rgb '#dddddd' "
      "fillstyle solid noborder\n"
      "unset key\nset multiplot\n",
      options.steps);
  for (std::size_t line = 0; line < lines; ++line) {
    if (line == 0) {
      text += "set palette defined (0 '#440154', 0.25 '#3b528b', 0.5 '#21918c', 0.75 '#5ec962', 1 '#fde725')\n";
      // A peak of a sharp lobe would leave no colours for the rest: the scale spans 1 to 99.5 per cent of the cells.
      const double low = std::floor(all[all.size() / 100]), high = std::ceil(all[(all.size() - 1) * 995 / 1000]);
      text += fmt::format("set cbrange [{:g}:{:g}]; set cbtics {:g} format '2^{{%g}}'\n", low,
                          std::max(high, low + 1.0), std::max(1.0, std::ceil((high - low) / 5.0)));
      text += colour_scale(line, "π {/:Italic f}");
    } else {
      text += diverging_palette;
      text += fmt::format("set cbrange [-{0:g}:{0:g}]; set cbtics {1:g} format '%g'\n", limit, limit / 2.0);
      text += colour_scale(line, "stops from the first");
    }
    for (std::size_t column = line; column < slices.size(); ++column) {
      text += panel_margins(column, line);
      if (line == 0) text += column_title(brdfs[column].label, 16);
      text += column == line ? "set format y '%g'\n" : "set format y ''\n";
      text += line + 1 == lines || column == 0 ? "set format x '%g'\n" : "set format x ''\n";
      text += fmt::format("plot ${}_{} matrix using (($1 + 0.5) * cell):(($2 + 0.5) * cell):3 with image\n",
                          line == 0 ? "slice" : "ratio", column + 1);
      text += "unset label; unset colorbox\n";
    }
    if (line + 1 < lines) text += "set colorbox\n";
  }
  return text + "unset multiplot\n";
}

FigureSize image_slice_figure_size(std::size_t brdfs) {
  const int columns = static_cast<int>(std::max<std::size_t>(brdfs, 1)), lines = columns > 1 ? 2 : 1;
  const int panel = std::clamp(960 / columns, 160, 360);
  return {174 + columns * panel + (columns - 1) * 10, 154 + lines * panel + (lines - 1) * 24};
}

}  // namespace lobefit
