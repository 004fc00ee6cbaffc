// Recipes: a refit from reference to result, as data.
//
// A recipe names a closed form with published constants, and rows. A row is a reference over a domain, and the sets of
// parameters to free on it. Every row is run on a Monte Carlo table and on an exact one; rivals are scored on the same
// tables. data/recipes/proxima.json is the worked example, data/schemas/recipe.json the schema.
//
// Recipes of other kinds are in curve_recipe.h, substrate_rules.h and approximation_recipe.h.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "fit/rival.h"
#include "reference/render.h"

namespace lobefit {

enum class RecipeKind { constants, curves, substrate_rules, approximations };
inline constexpr std::array<std::string_view, 4> recipe_kind_names{"constants", "curves", "substrate_rules",
                                                                   "approximations"};
/// What a recipe's "kind" says; without one it is of constants. Throws Error(invalid_input).
RecipeKind recipe_kind(const std::filesystem::path& path);

struct RecipeRow {
  std::string name;
  std::string views;  // "all" or "normal_slice"
  std::string model;  // the recipe's, or a variant of it with the same parameters
  std::vector<std::pair<std::string, std::vector<double>>> fixed;  // of the model, whatever the recipe says
  std::string reference;
  ParameterValues reference_values;
  std::string grid_name;  // as the recipe gives it, for the record
  Grid grid;
  Quantity quantity = Quantity::cosine;
  std::vector<WeightFactor> weights;
  std::vector<std::vector<std::string>> free_sets;
};

struct Recipe {
  std::string name, title, description;
  std::string model;
  ParameterValues fixed;                                  // of the model, before anything is freed
  std::vector<std::string> fixed_names;                   // those that the recipe states: they outrank the reference's
  std::vector<std::pair<std::string, double>> published;  // constants to be checked
  std::vector<Axis> parameter_axes;
  std::uint64_t samples = 1u << 14;
  bool shared_facets = true;
  double tolerance = 0.0;  // a row reproduces the published constants if it meets them this closely
  std::vector<Rival> rivals;
  std::vector<RecipeRow> rows;

  /// Throws Error(invalid_input) with the JSON path.
  static Recipe read(const std::filesystem::path& path);
};

/// One line of the result: a row, a method and a set of free parameters.
struct RecipeResultRow {
  const RecipeRow* row;
  std::string method;  // "monte_carlo" or "exact"
  std::size_t table;   // in RecipeResult::tables
  std::vector<std::string> free;
  ParameterValues published;  // where the fit starts
  Fit fit;
  double rms_published = 0.0, rms_refit = 0.0;
  std::vector<float> published_values, refit_values;  // over the row's table
  std::vector<RivalScore> rivals;
};

/// A table that rows with the same reference and grid share.
struct RecipeTable {
  std::string name;  // file stem
  const RecipeRow* row;
  std::string method;
  Table table;
};

struct RecipeResult {
  std::vector<RecipeTable> tables;
  std::vector<RecipeResultRow> rows;
  std::string conclusion;

  Json json(const Recipe& recipe, const std::string& command, std::uint64_t seed) const;
};

/// Renders, fits and scores every row. The recipe must outlive the result.
RecipeResult run_recipe(const Recipe& recipe, std::uint64_t seed, Monitor& monitor);

}  // namespace lobefit
