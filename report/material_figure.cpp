#include "report/material_figure.h"

#include <array>
#include <cmath>
#include <limits>

#include "models/error.h"
#include "reference/srgb.h"
#include "report/figure_layout.h"

namespace lobefit {

using namespace figure_layout;

namespace {

constexpr std::array view_angles{5.0, 30.0, 55.0, 75.0};

std::size_t nearest(const Axis& axis, double angle) {
  const auto found = std::ranges::min_element(
      axis.values, [&](double x, double y) { return std::abs(x - angle) < std::abs(y - angle); });
  return static_cast<std::size_t>(found - axis.values.begin());
}

/// Entries of one view in the plane of incidence with their signed θi, from the mirror side to the retro side.
std::vector<std::pair<double, std::size_t>> plane_of_incidence(const Table& table, std::size_t theta_o) {
  const Axis &theta_i = table.grid.theta_i, &phi = table.grid.phi;
  const std::size_t retro = nearest(phi, 0.0), mirror = nearest(phi, 180.0);
  const auto entry = [&](std::size_t i, std::size_t k) { return k + phi.size() * (i + theta_i.size() * theta_o); };
  std::vector<std::pair<double, std::size_t>> line;
  for (std::size_t i = theta_i.size(); i-- > 0;) line.emplace_back(-theta_i.values[i], entry(i, mirror));
  for (std::size_t i = 0; i < theta_i.size(); ++i) line.emplace_back(theta_i.values[i], entry(i, retro));
  return line;
}

/// 8-bit sRGB of a linear radiance.
int display(double radiance) {
  return static_cast<int>(std::lround(255.0 * srgb_encode(std::clamp(radiance, 0.0, 1.0))));
}

/// Datablocks of the spheres on white, at the exposure that shows a twentieth of the first one's pixels at full white.
std::string sphere_blocks(std::span<const SphereImage> spheres) {
  if (spheres.empty()) return "";
  std::vector<float> levels;
  for (std::size_t pixel = 0; pixel < spheres[0].pixels(); ++pixel) {
    if (spheres[0].cover[pixel] > 0.0f) {
      const float* rgb = spheres[0].rgb.data() + 3 * pixel;
      levels.push_back(std::max({rgb[0], rgb[1], rgb[2]}));
    }
  }
  double scale = 1.0;
  if (!levels.empty()) {
    const auto bright = levels.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(levels.size() - 1));
    std::ranges::nth_element(levels, bright);
    if (*bright > 0.0f) scale = 1.0 / static_cast<double>(*bright);
  }
  std::string text;
  for (std::size_t k = 0; k < spheres.size(); ++k) {
    text += fmt::format("$sphere_{} << EOD\n", k);
    const auto size = static_cast<std::size_t>(spheres[k].size);
    for (std::size_t pixel = 0; pixel < spheres[k].pixels(); ++pixel) {
      text += fmt::format("{} {}", pixel % size, size - 1 - pixel / size);
      for (std::size_t c = 0; c < 3; ++c) {
        const double cover = spheres[k].cover[pixel];
        const int own = display(scale * spheres[k].rgb[3 * pixel + c]);
        text += fmt::format(" {}", static_cast<int>(std::lround(cover * own + (1.0 - cover) * 255.0)));
      }
      text += "\n";
    }
    text += "EOD\n";
  }
  return text;
}

/// The spheres one above the other, in the place of the panel after the last.
std::string sphere_panels(std::span<const SphereImage> spheres, std::size_t column) {
  constexpr std::array titles{"measured", "fitted"};
  std::string text =
      "unset logscale; unset border; unset xtics; unset ytics; unset grid; unset label 3; unset label 4\n";
  for (std::size_t k = 0; k < spheres.size(); ++k) {
    text += fmt::format(
        "set lmargin at screen across(left + {0} * (panel_width + gap_across))\n"
        "set rmargin at screen across(left + {0} * (panel_width + gap_across) + panel_width)\n"
        "set tmargin at screen down(top + {1} * panel_height / 2 + 4)\n"
        "set bmargin at screen down(top + {2} * panel_height / 2 - 22)\n"
        "set title '{3}' offset 0, -0.6 font ''.plain({4})\n"
        "set size ratio -1; set xrange [0:{5}]; set yrange [0:{5}]\n"
        "plot $sphere_{1} using 1:2:3:4:5 with rgbimage\n",
        column, k, k + 1, titles[k], label_size, spheres[k].size);
  }
  return text;
}

}  // namespace

FigureSize material_figure_size() { return {1400, 520}; }

std::string material_figure(const Table& measured, std::span<const float> fitted, std::span<const SphereImage> spheres,
                            const std::string& title, const std::string& subtitle) {
  if (measured.coordinates != Coordinates::spherical) {
    throw Error(ExitCode::usage, "the material lies on no grid of angles", "figure", "fit it with --grid measured");
  }
  const std::array<const char*, 3> colours =
      measured.channels == 3 ? std::array{"#D0312D", "#2E8B57", "#1F5FBF"} : std::array{"#333333", "", ""};
  std::string text = header(title, subtitle);
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (std::size_t view = 0; view < view_angles.size(); ++view) {
    const auto line = plane_of_incidence(measured, nearest(measured.grid.theta_o, view_angles[view]));
    for (int c = 0; c < measured.channels; ++c) {
      text += fmt::format("$slice_{}_{} << EOD\n", view, c);
      for (const auto& [angle, entry] : line) {
        if (!measured.valid[entry]) continue;
        const double cosine = measured.wi(entry).z;
        const double truth = cosine * measured.value(entry, c);
        const double fit = cosine * fitted[static_cast<std::size_t>(c) * measured.entries() + entry];
        // A logarithm has no place for what is not positive.
        text += fmt::format("{:.4g} {} {:.6g}\n", angle, truth > 0.0 ? fmt::format("{:.6g}", truth) : "NaN",
                            std::max(fit, 1e-12));
        if (truth > 0.0) least = std::min(least, truth);
        most = std::max({most, truth, fit});
      }
      text += "EOD\n";
    }
  }
  const double top = std::pow(10.0, std::ceil(std::log10(std::max(most, 1e-6))));
  const double bottom = std::max(std::pow(10.0, std::floor(std::log10(std::min(least, most)))), 1e-7 * top);
  text +=
      "left = 74.0; right = figure_width - 20.0; top = 84.0; bottom = figure_height - 50.0\n"
      "gap_across = 22.0; gap_down = 40.0\n";
  text += sphere_blocks(spheres) + panel_layout(view_angles.size() + (spheres.empty() ? 0 : 1), 1) +
          shared_axis_labels("θ_i in degrees: mirror side at the left, retro side at the right", "f cos θ_i");
  text +=
      "set grid linetype 1 linewidth 0.5 linecolor rgb '#e4e4e4' dashtype solid\n"
      "set xrange [-90:90]; set xtics -60, 30; set logscale y; set format y '10^{%T}'\n";
  text += fmt::format("set yrange [{:.6g}:{:.6g}]\nunset key\nset multiplot\n", bottom, top);
  for (std::size_t view = 0; view < view_angles.size(); ++view) {
    text += panel_margins(view, 0);
    const double angle = measured.grid.theta_o.values[nearest(measured.grid.theta_o, view_angles[view])];
    text += fmt::format("set title 'θ_o = {:.1f}°' offset 0, -0.6 font ''.plain({})\n", angle, label_size);
    if (view == 1) text += "set format y ''\n";
    text += "plot";
    for (int c = 0; c < measured.channels; ++c) {
      text += fmt::format(
          "{0} $slice_{1}_{2} using 1:2 with points pointtype 7 pointsize 0.35 linecolor rgb '{3}', "
          "$slice_{1}_{2} using 1:3 with lines linewidth 1.6 linecolor rgb '{3}'",
          c > 0 ? "," : "", view, c, colours[static_cast<std::size_t>(c)]);
    }
    text += "\n";
  }
  if (!spheres.empty()) text += sphere_panels(spheres, view_angles.size());
  return text + "unset multiplot\n";
}

}  // namespace lobefit
