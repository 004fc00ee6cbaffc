// One self-contained HTML page of a result: it opens from a file, asks no network, and carries its numbers.
//
//   HtmlReport report{.title = "Proxima's constants", .command = "lobefit refit proxima"};
//   report.tables.push_back({.caption = "Constants", .header = {"row", "a"}, .lines = {{"all_views", "-0.551"}}});
//   const std::string page = html_report(report);
//
// Texts are plain: html_report() escapes them. What a reader moves (slices, residual maps, spheres) is drawn by the
// scripts of report/page/, which are compiled in; tables, figures and shaders are there without scripts too.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "models/registry.h"
#include "reference/metric.h"
#include "reference/table.h"

namespace lobefit {

struct HtmlTable {
  std::string caption;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> lines;  // as long as the header; the first cell names the line
  std::string note;
};

/// Numbers from -1 to 1 between things of the same names, shaded by their size.
struct HtmlMatrix {
  std::string caption;
  std::vector<std::string> names;
  std::vector<std::vector<double>> values;  // square
  std::string note;
};

/// Numbers against a number, drawn when the page is made: no control.
struct HtmlChart {
  struct Line {
    std::string label;
    std::vector<std::pair<double, double>> points;  // what is not finite is left out
    bool joined = true;                             // else points alone
  };
  std::string title, horizontal, vertical;
  bool logarithmic = false;  // the vertical axis; what is not positive is left out
  std::vector<Line> lines;
  std::string note;
};

/// A picture, its file's bytes.
struct HtmlFigure {
  std::string title;
  std::string media_type;  // "image/svg+xml" or "image/png"
  std::string content;
};

struct HtmlShader {
  std::string language;  // as of shader_languages()
  std::string text;
};

/// A model over a table's grid, to be drawn against it.
struct HtmlLine {
  std::string label;
  std::vector<float> values;  // as Table::values
};

/// A spherical table to be cut along its angles, and lines to compare.
struct HtmlSlices {
  std::shared_ptr<const Table> reference;
  std::string label;  // of the reference
  Quantity quantity = Quantity::cosine;
  std::vector<HtmlLine> lines;
};

/// A set of constants to be shown: the model's flat parameters in each parameter row of the slices' table, or one set
/// for all.
struct HtmlSphere {
  std::string label;
  std::vector<std::vector<double>> rows;
};

/// Lit spheres, polar lobes and image slices, drawn by the row's GLSL text, which must define
/// `vec3 Lobefit_NAME(wi, wo, parameters)`; beside them the slices' reference.
struct HtmlExplorer {
  const Model* model = nullptr;
  std::vector<HtmlSphere> spheres;  // parameters that all of them share have one slider
  /// Parameters that differ by meaning: they have a slider per sphere even where values agree.
  std::vector<std::string> fitted;
};

/// A part of the result that a reader chooses.
struct HtmlRow {
  std::string name, note;
  std::vector<HtmlTable> tables;
  std::vector<HtmlMatrix> matrices;
  std::vector<HtmlChart> charts;
  HtmlSlices slices;      // without a reference: none
  HtmlExplorer explorer;  // without a model: none
  std::vector<HtmlShader> shaders;
  std::vector<HtmlFigure> figures;
};

struct HtmlReport {
  std::string title, description, conclusion, command;
  std::vector<HtmlTable> tables;
  std::vector<HtmlChart> charts;
  std::vector<HtmlRow> rows;
  std::vector<std::pair<std::string, std::string>> provenance;
  /// What the folder lacks, or the page leaves out.
  std::vector<std::string> remarks;
};

/// The page. Tables are kept with three significant digits (half precision; differences to the reference apart, so that
/// residuals have three digits of their own), and where all of them together are large, with evenly spread parameter
/// rows and angles; remarks then say so. Throws Error(usage) for slices of a table that is not spherical.
std::string html_report(HtmlReport report);

}  // namespace lobefit
