// Figures of tables: slices and residual maps, drawn by gnuplot.
//
//   SliceChoice choice{.theta_o = 12, .both_sides = true};                     // view at 60°, alpha spread over its
//   axis const std::vector<LabelledTable> models{{"lambert", TableModel(lambert, values, reference).render()}};
//   write_figure(slice_figure(reference, models, choice, "Rough diffuse"), "slice.svg", /*overwrite=*/false);
//
// The first step makes a gnuplot program that holds all of its data, the second runs it. A program knows its size as
// figure_width and figure_height (pixels), so that it can also be run by hand, at another size or terminal.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "reference/table.h"

namespace lobefit {

/// A table to be compared with a reference over the same grid: TableModel::render(), or another reference.
struct LabelledTable {
  std::string label;
  Table table;
};

/// What to cut out of a table: indices into its axes.
struct SliceChoice {
  std::size_t theta_o = 0, phi = 0;
  std::vector<std::size_t> parameter_rows;  // a panel each; empty: up to 6 spread over the parameter axes
  bool both_sides = false;                  // slices: also the azimuth 180° - phi, at negative theta_i
};

/// In pixels.
struct FigureSize {
  int width = 1000, height = 700;
};

/// π f cos θi over θi at one view, a panel per parameter row. The reference is drawn as points with 95 % error bars,
/// each model as a line; channels are averaged, masked entries left out. Axes are shared by all panels. Throws
/// Error(usage) if the choice leaves the table, or a model's table has other axes.
std::string slice_figure(const Table& reference, const std::vector<LabelledTable>& models, const SliceChoice& choice,
                         const std::string& title);
/// A size that gives slice panels good proportions.
FigureSize slice_figure_size(const Table& reference, const SliceChoice& choice);

/// π (f_model - f_reference) cos θi over θi and θo at the azimuth choice.phi: a column of panels per model, a line per
/// parameter row, on one colour scale that is white at 0. Each panel states the rms of its own entries. Throws
/// Error(usage) as above, and if the table has a single view.
std::string residual_figure(const Table& reference, const std::vector<LabelledTable>& models, const SliceChoice& choice,
                            const std::string& title);
/// A size that makes residual panels square.
FigureSize residual_figure_size(const Table& reference, std::size_t models, const SliceChoice& choice);

/// Runs a gnuplot program and writes its picture, whole or not at all: SVG or PNG by the extension of `path`. Throws
/// Error(usage) for another extension or size, or if `path` exists and `overwrite` is false; Error(missing_part) if
/// gnuplot is not installed; Error(failure) with gnuplot's own words if it fails.
void write_figure(const std::string& gnuplot_program, const std::filesystem::path& path, bool overwrite,
                  FigureSize size = {});

}  // namespace lobefit
