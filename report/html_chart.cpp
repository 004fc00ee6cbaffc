#include "report/html_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/html_values.h"

namespace lobefit {

namespace {

// Small enough for a phone without shrinking the letters.
constexpr double width = 360.0, height = 230.0;
constexpr double left = 52.0, right = 12.0, top = 12.0, bottom = 40.0;
constexpr std::size_t colours = 5;

struct ChartAxis {
  double low = 0.0, high = 1.0;
  bool logarithmic = false;

  double at(double value) const {
    return logarithmic ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
  }
  std::vector<double> ticks() const {
    std::vector<double> list;
    const double decades = std::log10(high / low);
    if (logarithmic && decades > 0.7) {
      const double step = std::pow(10.0, std::ceil(decades / 6.0));
      for (double power = std::pow(10.0, std::floor(std::log10(low))); power <= high; power *= step) {
        for (const double factor : {1.0, 2.0, 5.0}) {
          if (factor > 1.0 && decades > 2.0) continue;
          if (factor * power >= low * 0.999 && factor * power <= high * 1.001) list.push_back(factor * power);
        }
      }
      return list;
    }
    const double rough = (high - low) / 4.0, power = std::pow(10.0, std::floor(std::log10(rough)));
    double step = 10.0 * power;
    for (const double factor : {5.0, 2.0, 1.0}) {
      if (factor * power >= 0.999 * rough) step = factor * power;
    }
    for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) list.push_back(k * step);
    return list;
  }
};

bool drawn(const std::pair<double, double>& point, bool logarithmic) {
  return std::isfinite(point.first) && std::isfinite(point.second) && (!logarithmic || point.second > 0.0);
}

/// From the least to the largest, with some room; linear axes of errors begin at 0.
ChartAxis axis_of(const std::vector<double>& values, bool logarithmic, bool from_zero) {
  const auto [least, most] = std::ranges::minmax(values);
  if (logarithmic) {
    // Beyond a tenth of a decade, so that a flat line lies in the middle.
    const double room = std::max(std::pow(most / least, 0.05), 1.1);
    return {least / room, most * room, true};
  }
  ChartAxis axis{from_zero ? std::min(least, 0.0) : least, most};
  const double room = axis.high > axis.low ? 0.05 * (axis.high - axis.low) : 0.5;
  if (!from_zero || axis.low < 0.0) axis.low -= room;
  axis.high += room;
  return axis;
}

std::string axes_svg(const HtmlChart& chart, const ChartAxis& across, const ChartAxis& up) {
  const auto x = [&](double value) { return left + across.at(value) * (width - left - right); };
  const auto y = [&](double value) { return height - bottom - up.at(value) * (height - top - bottom); };
  std::string svg;
  for (const double tick : up.ticks()) {
    svg += fmt::format(
        "<path class=\"grid\" d=\"M{0:.1f} {1:.1f}H{2:.1f}\"/><text x=\"{3:.1f}\" y=\"{4:.1f}\" "
        "text-anchor=\"end\">{5:.4g}</text>\n",
        left, y(tick), width - right, left - 5.0, y(tick) + 4.0, std::abs(tick) < 1e-12 ? 0.0 : tick);
  }
  for (const double tick : across.ticks()) {
    svg += fmt::format(
        "<path class=\"grid\" d=\"M{0:.1f} {1:.1f}V{2:.1f}\"/><text x=\"{0:.1f}\" y=\"{3:.1f}\" "
        "text-anchor=\"middle\">{4:.4g}</text>\n",
        x(tick), top, height - bottom, height - bottom + 15.0, std::abs(tick) < 1e-12 ? 0.0 : tick);
  }
  return svg + fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                           (left + width - right) / 2.0, height - 6.0, escaped(chart.horizontal));
}

std::string line_svg(const HtmlChart::Line& line, std::size_t number, bool logarithmic, const ChartAxis& across,
                     const ChartAxis& up) {
  std::string path, dots;
  for (const auto& point : line.points) {
    if (!drawn(point, logarithmic)) continue;
    const double x = left + across.at(point.first) * (width - left - right);
    const double y = height - bottom - up.at(point.second) * (height - top - bottom);
    path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x, y);
    dots += fmt::format("<circle class=\"dot-{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\"/>", number % colours, x, y,
                        line.joined ? 2 : 3);
  }
  if (!line.joined || path.empty()) return dots + "\n";
  return fmt::format("<path class=\"line stroke-{}\" d=\"{}\"/>{}\n", number % colours, path, dots);
}

}  // namespace

std::string chart_html(const HtmlChart& chart) {
  std::vector<double> across, up;
  for (const HtmlChart::Line& line : chart.lines) {
    for (const auto& point : line.points) {
      if (!drawn(point, chart.logarithmic)) continue;
      across.push_back(point.first);
      up.push_back(point.second);
    }
  }
  if (up.empty()) return "";
  const ChartAxis x = axis_of(across, false, false), y = axis_of(up, chart.logarithmic, true);
  std::string html = "<figure class=\"chart static\"><figcaption>" + escaped(chart.title) + "</figcaption>\n";
  html += fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n", width, height,
                      escaped(chart.title + ": " + chart.vertical + " over " + chart.horizontal));
  html += axes_svg(chart, x, y);
  for (std::size_t k = 0; k < chart.lines.size(); ++k) html += line_svg(chart.lines[k], k, chart.logarithmic, x, y);
  html += "</svg>\n<p class=\"note\">Upwards: " + escaped(chart.vertical) + ".";
  for (std::size_t k = 0; k < chart.lines.size(); ++k) {
    html += fmt::format(" <span class=\"key\"><span class=\"swatch edge-{}\"></span>{}</span>", k % colours,
                        escaped(chart.lines[k].label));
  }
  html += "</p>\n";
  if (!chart.note.empty()) html += "<p class=\"note\">" + escaped(chart.note) + "</p>\n";
  return html + "</figure>\n";
}

std::string matrix_html(const HtmlMatrix& matrix) {
  const std::string caption = escaped(matrix.caption);
  std::string html = "<section class=\"wide\"><h4>" + caption +
                     "</h4>\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"" + caption +
                     "\"><table class=\"matrix\">\n<thead><tr><td></td>";
  for (const std::string& name : matrix.names) html += "<th scope=\"col\"><span>" + escaped(name) + "</span></th>";
  html += "</tr></thead>\n<tbody>\n";
  for (std::size_t k = 0; k < matrix.names.size(); ++k) {
    html += "<tr><th scope=\"row\">" + escaped(matrix.names[k]) + "</th>";
    for (const double value : matrix.values[k]) {
      // Ten shades either way: a class, for the page's style allows no colours of elements.
      const int shade = static_cast<int>(std::lround(10.0 * std::clamp(std::abs(value), 0.0, 1.0)));
      html += fmt::format("<td class=\"{} s{}\">{:.2f}</td>", value < 0.0 ? "low" : "high", shade, value);
    }
    html += "</tr>\n";
  }
  html += "</tbody></table></div>\n";
  if (!matrix.note.empty()) html += "<p class=\"note\">" + escaped(matrix.note) + "</p>\n";
  return html + "</section>\n";
}

}  // namespace lobefit
