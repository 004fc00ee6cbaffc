// Every metric of two BRDFs in one report: those of the BRDFs themselves, and how far apart their spheres look.
//
//   const TableModel on_table(model, fitted_values, file.table, mappings);
//   const Table rendered = on_table.render();
//   const MetricsReport report = metrics_report(model_pair(file, on_table, rendered.values));
//   document["report"] = report.json(file.table);
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "reference/brdf_difference.h"
#include "reference/formats/brdf_file.h"
#include "report/image_difference.h"

namespace lobefit {

struct ReportOptions {
  int sphere_size = 64;              // pixels across; 0 leaves spheres out
  std::size_t most_sphere_rows = 6;  // of tables with parameter axes, spread over their rows
};

struct SphereDifference {
  std::size_t row;       // of the table's parameter axes
  std::string lighting;  // of lighting_names
  ImageDifference image;
  double cover;  // share of the sphere at which both BRDFs have a value
};

struct MetricsReport {
  BrdfDifference brdf;
  int sphere_size = 0;
  std::vector<SphereDifference> spheres;  // rows outermost
  std::vector<NotFormed> not_formed;      // of the spheres; those of the BRDFs are brdf.not_formed

  /// Mean over the rows; nothing where no sphere was rendered.
  std::optional<double> mean(std::string_view lighting, double ImageDifference::*member) const;
  /// Of BrdfDifference::json() and "sphere".
  Json json(const Table& table) const;
};

MetricsReport metrics_report(const BrdfPair& pair, const ReportOptions& options = {});

/// A model laid over a file's table; `values` are those of TableModel::render(). The pair refers to all three. Between
/// the points of a grid both are interpolated alike, so that only what the table tells counts; where the file is known
/// everywhere, so is the model.
BrdfPair model_pair(const BrdfFile& file, const TableModel& model, std::span<const float> values);

}  // namespace lobefit
