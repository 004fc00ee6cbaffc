// What gnuplot programs of several panels have in common: text, sizes and places.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>

namespace lobefit::figure_layout {

/// Okabe and Ito's colours, which the colour-blind tell apart, without black (the reference) and yellow (too pale); the
/// dashes, in multiples of the line width, tell them apart in grey.
struct LineStyle {
  const char *colour, *dashes;
};
inline constexpr std::array<LineStyle, 7> line_styles{{{"#D55E00", "solid"},
                                                       {"#0072B2", "(12,5)"},
                                                       {"#009E73", "(3,3.5)"},
                                                       {"#E69F00", "(14,4,3,4)"},
                                                       {"#CC79A7", "(7,4)"},
                                                       {"#56B4E9", "(14,3.5,3,3.5,3,3.5)"},
                                                       {"#777777", "(22,7)"}}};

/// Bytes of the character that `text`, which is not empty, starts with; 0 if it is not UTF-8.
inline std::size_t character_bytes(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  const std::size_t count = lead < 0x80 ? 1 : lead < 0xC2 ? 0 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : lead < 0xF5 ? 4 : 0;
  if (count == 0 || count > text.size()) return 0;
  const auto continues = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; };
  return std::ranges::all_of(text.substr(1, count - 1), continues) ? count : 0;
}

/// A gnuplot string in which nothing is special: within single quotes only the quote itself is, and it is doubled. What
/// is no text, such as the bytes of a file name in another encoding, becomes a question mark: SVG could not hold it.
inline std::string literal(std::string_view text) {
  std::string result = "'";
  while (!text.empty()) {
    const std::size_t count = character_bytes(text);
    if (count == 0) {
      result += '?';
    } else if (static_cast<unsigned char>(text[0]) < 0x20) {
      result += ' ';
    } else {
      result += text[0] == '\'' ? "''" : text.substr(0, count);
    }
    text.remove_prefix(std::max<std::size_t>(count, 1));
  }
  return result + "'";
}

/// Text that gnuplot's enhanced mode, which sets subscripts, shows as it is.
inline std::string escaped(const std::string& text) {
  std::string result;
  for (const char character : text) {
    if (std::string_view("^_{}@&~\\").find(character) != std::string_view::npos) result += '\\';
    result += character;
  }
  return result;
}

/// Characters of UTF-8 text.
inline std::size_t length(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

/// The next of 1, 2, 3, 4, 5, 6, 8, 10 and their decades: numbers whose half is short.
inline double round_up(double value) {
  if (!(value > 0.0)) return 1.0;
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0}) {
    if (value <= step * decade * (1.0 + 1e-9)) return step * decade;
  }
  return 10.0 * decade;
}

/// Distance of axis ticks that divides `span` into about `count` parts.
inline double tick_step(double span, int count) {
  const double raw = span / count;
  const double decade = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (raw <= step * decade * (1.0 + 1e-9)) return step * decade;
  }
  return 10.0 * decade;
}

/// ColorBrewer's RdBu with blue below and red above a true white.
inline constexpr const char* diverging_palette =
    "set palette defined (0 '#053061', 1 '#2166ac', 2 '#4393c3', 3 '#92c5de', 4 '#d1e5f0', 5 '#ffffff', "
    "6 '#fddbc7', 7 '#f4a582', 8 '#d6604d', 9 '#b2182b', 10 '#67001f') maxcolors 255\n";

// ---- Layout, in pixels from the top left ------------------------------------------------------------------------

inline constexpr double title_size = 16.0, label_size = 12.0, tick_size = 11.0;
/// Mean width of a character of DejaVu Sans in units of its size: 0.6, and 0.68 in bold.
inline constexpr double character_width = 0.6;

/// What both figures start with: size, coordinates, fonts, lines of the axes, title. fitting() and shortened() keep a
/// text within `room` pixels: first it gets smaller, down to 8 pixels, then it is cut. gnuplot takes a call for a
/// string only where one precedes it, hence the ''.
inline std::string header(const std::string& title, const std::string& subtitle) {
  return fmt::format(
      "set encoding utf8\n"
      "set minussign\n"
      "if (!exists('figure_width')) figure_width = 1000\n"
      "if (!exists('figure_height')) figure_height = 700\n"
      "across(pixels) = 1.0 * pixels / figure_width\n"
      "down(pixels) = 1.0 - 1.0 * pixels / figure_height\n"
      "at_8(text) = 0.68 * 8 * strlen(text)\n"
      "fitting(text, size, room) = at_8(text) * size / 8 <= room ? size : "
      "at_8(text) < room ? 8 * room / at_8(text) : 8\n"
      "shortened(text, room) = at_8(text) <= room ? text : text[1:int(room / (0.68 * 8)) - 1].'…'\n"
      "bold(size) = sprintf('DejaVu Sans:Bold,%.1f', size)\n"
      "plain(size) = sprintf('DejaVu Sans,%.1f', size)\n"
      "figure_title = {}\n"
      "figure_subtitle = {}\n"
      "set label 1 ''.shortened(figure_title, figure_width - 32) at screen across(16), down(24) left noenhanced "
      "font ''.bold(fitting(figure_title, {}, figure_width - 32))\n"
      "set label 2 figure_subtitle at screen across(16), down(46) left textcolor rgb '#555555' "
      "font ''.plain(fitting(figure_subtitle, {}, figure_width - 32))\n"
      "set border 3 linecolor rgb '#555555' linewidth 1\n"
      "set tics nomirror out scale 0.5 font ''.plain({}) textcolor rgb '#000000'\n",
      literal(title), literal(subtitle), title_size, label_size, tick_size);
}

/// Places `columns` × `lines` panels between the margins that the text before it has set: left, right, top, bottom,
/// gap_across, gap_down.
inline std::string panel_layout(std::size_t columns, std::size_t lines) {
  return fmt::format(
      "panel_width = (right - left - {1} * gap_across) / {0}\n"
      "panel_height = (bottom - top - {3} * gap_down) / {2}\n"
      "if (panel_width < 40 || panel_height < 40) "
      "printerr 'the figure is too small for {0} × {2} panels'; exit status 2\n",
      columns, columns - 1, lines, lines - 1);
}

inline std::string panel_margins(std::size_t column, std::size_t line) {
  return fmt::format(
      "set lmargin at screen across(left + {0} * (panel_width + gap_across))\n"
      "set rmargin at screen across(left + {0} * (panel_width + gap_across) + panel_width)\n"
      "set tmargin at screen down(top + {1} * (panel_height + gap_down))\n"
      "set bmargin at screen down(top + {1} * (panel_height + gap_down) + panel_height)\n",
      column, line);
}

/// Label 5: what stands `above` pixels over the panels of a column.
inline std::string column_title(const std::string& title, int above) {
  return fmt::format(
      "column_title = {}\n"
      "set label 5 ''.shortened(column_title, panel_width) at graph 0.5, screen down(top - {}) center "
      "noenhanced font ''.bold(fitting(column_title, {}, panel_width))\n",
      literal(title), above, label_size);
}

/// Labels of the shared axes, set once for all panels.
inline std::string shared_axis_labels(const std::string& horizontal, const std::string& vertical) {
  return fmt::format(
      "set label 3 {} at screen across((left + right) / 2), down(bottom + 36) center\n"
      "set label 4 {} at screen across(18), down((top + bottom) / 2) center rotate by 90\n",
      literal(horizontal), literal(vertical));
}

}  // namespace lobefit::figure_layout
