// Recipes of curves: a model's parameters as functions of alpha, as data.
//
// Every model is fitted to every reference at every albedo and alpha on its own, once with the contested parameters
// free and once with them held: a row each. Then all alphas together, each free parameter a quadratic in √α, which
// must not lose much against the rows. data/recipes/tangent-falloffs.json is the worked example,
// data/schemas/curve_recipe.json the schema.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fit/fit.h"
#include "reference/render.h"

namespace lobefit {

struct CurveModel {
  std::string model, label;
  ParameterValues values;  // what is held, and where nothing is said its default
  std::string rival;       // the model to be held against, or ""
  std::string verdict;     // what it means to lose against it
};

struct CurveReference {
  std::string name;
  std::string reference;
  ParameterValues values;
  std::vector<double> albedos;
};

/// A model as it is against a reference with the same parameters; for scale, both without them ("plain").
struct CurveComparison {
  std::string name;
  std::vector<double> alphas;
  std::uint64_t samples = 1u << 13;
  std::string reference;
  ParameterValues values, plain_values;
  std::string model;
  ParameterValues model_values, plain_model_values;
};

struct CurveRecipe {
  std::string name, title, description;
  std::vector<double> alphas;
  std::string grid_name;
  Grid grid;
  Quantity quantity = Quantity::cosine;
  std::vector<WeightFactor> weights;
  std::vector<CurveReference> references;
  std::vector<CurveModel> models;  // the first is the one that the conclusion is about
  std::vector<std::string> free;
  std::string contested_name, claim;
  std::vector<std::string> contested;
  std::vector<FitBounds> bounds;       // where parameters may leave their models' ranges
  std::vector<FitBounds> wide_bounds;  // of the probe for what lies beyond
  std::vector<FitBounds> usable;       // where a parameter still means what its name says; albedo per unit of albedo
  std::vector<std::vector<std::pair<std::string, double>>> starts;
  double tolerance = 0.1;  // what curves may lose, relative to the rows' rms
  std::vector<CurveComparison> comparisons;

  /// Throws Error(invalid_input) with the JSON path.
  static CurveRecipe read(const std::filesystem::path& path);
};

/// One model at one alpha against one reference of one albedo: the lowest usable minimum. rms are per unit of albedo.
struct CurveRow {
  std::size_t series, alpha;
  Fit fit;
  double rms_default = 0.0;  // of the model as the recipe gives it, at the reference's albedo
  double rms = 0.0;
  std::optional<Fit> lowest;  // a lower minimum that is not usable
  double rms_lowest = 0.0;
  std::optional<Fit> beyond;  // where a parameter is at its bound: the fit with wider ones
  double rms_beyond = 0.0;
};

/// c0 + c1 √α + c2 α, held within its bounds.
struct Curve {
  std::string parameter;
  std::array<double, 3> coefficients;
  double lower, upper;

  double at(double alpha) const;
};

/// A model, a reference, an albedo, and whether the contested parameters are free: rows and curves over alpha.
struct CurveSeries {
  const CurveModel* model;
  const CurveReference* reference;
  double albedo;
  bool contested_free;
  std::vector<std::string> free;
  std::vector<Curve> curves;
  std::vector<double> rms;  // of the curves, per alpha
  double worst_loss = 0.0;  // largest rms/row rms - 1
};

/// Of a comparison, at one alpha.
struct ComparisonRow {
  const CurveComparison* comparison;
  double alpha;
  double rms;         // model against reference
  double rms_plain;   // plain model against plain reference
  double rms_effect;  // reference against plain reference: what the shared parameters do there
  double rms_missed;  // what they do to the model against what they do to the reference
};

struct CurveTable {
  std::string name;  // file stem
  Table table;
};

struct CurveResult {
  std::vector<CurveTable> tables;   // one per reference, over alpha
  std::vector<CurveSeries> series;  // in pairs: contested parameters free, and held
  std::vector<CurveRow> rows;       // series by series, alphas in order
  std::vector<ComparisonRow> comparisons;
  std::string conclusion;

  const CurveRow& row(std::size_t series_index, std::size_t alpha, const CurveRecipe& recipe) const {
    return rows[series_index * recipe.alphas.size() + alpha];
  }
  Json json(const CurveRecipe& recipe, const std::string& command, std::uint64_t seed) const;
};

/// The table that a series is fitted to.
Table series_table(const CurveRecipe& recipe, const CurveResult& result, const CurveSeries& series);
/// A series' rows over its table.
std::vector<float> series_values(const CurveRecipe& recipe, const CurveResult& result, std::size_t series);

/// Renders, fits and scores everything; `seed` is that of sampled comparisons. The recipe must outlive the result. The
/// same bits for any number of threads.
CurveResult run_recipe(const CurveRecipe& recipe, std::uint64_t seed, Monitor& monitor);

}  // namespace lobefit
