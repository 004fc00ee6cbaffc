// Recipes of closed forms against the exact functions that they stand for: constants as published, refitted, and the
// reading (domain, metric, norm) under which the published ones would be the best, if one is found.
// data/recipes/fresnel.json is the shortest example, data/schemas/approximation_recipe.json the schema.
#pragma once

#include <filesystem>
#include <optional>

#include "fit/forms.h"
#include "reference/json_reader.h"
#include "reference/monitor.h"
#include "reference/targets.h"

namespace lobefit {

enum class FormMetric { absolute, relative };  // form - target, or that over the target
inline constexpr std::array<std::string_view, 2> form_metric_names{"absolute", "relative"};
enum class FormNorm { rms, max };
inline constexpr std::array<std::string_view, 2> form_norm_names{"rms", "max"};

/// An argument of the target over the domain, and the numbers that the recipe gives for it.
struct DomainAxis {
  std::string argument;
  std::vector<double> values;
  std::vector<double> given;  // degrees, where values are their cosines or sines
  bool degrees = false;
};

struct FormDomain {
  std::string label;  // "" for the row's own
  std::vector<DomainAxis> axes;
};

/// A constant as published: `digit` is half a unit of its last printed digit; 0 for exact ones, as ½ or 1.
struct PublishedConstant {
  double value, digit;
};

struct ApproximationRow {
  std::string name, note;
  const Form* form = nullptr;
  const Target* target = nullptr;
  std::vector<double> target_values;  // of its arguments off the domain
  FormDomain domain;
  std::vector<FormDomain> other_domains;  // readings of where the published constants come from
  std::string each;                       // an argument for each value of which the form is refitted; may be empty
  std::vector<double> each_values{0.0};
  FormMetric metric = FormMetric::relative;
  FormNorm norm = FormNorm::rms;
  std::vector<std::size_t> free;             // constants
  std::vector<PublishedConstant> published;  // all constants
  bool has_published = true;                 // or starting values only
  std::vector<const Form*> rivals;           // scored with their published constants
  std::string integral;                      // an argument, a cosine, over whose angle both are integrated

  std::vector<double> published_values() const;
};

struct ApproximationRecipe {
  std::string name, title, description;
  std::vector<ApproximationRow> rows;

  /// Throws Error(invalid_input) with the JSON path.
  static ApproximationRecipe read(const std::filesystem::path& path);
};

struct FormScore {
  double rms = 0.0, max = 0.0;  // in the row's metric
};

struct RefittedConstant {
  double value = 0.0, standard_error = 0.0, ci_low = 0.0, ci_high = 0.0;
  bool free = false, at_bound = false, identifiable = true;
};

/// A domain, metric and norm, and the constants that are best there.
struct FormReading {
  std::string domain;
  FormMetric metric = FormMetric::absolute;
  FormNorm norm = FormNorm::rms;
  std::vector<double> constants;
  double distance = 0.0;  // from the published: the largest relative difference of a free constant
  bool meets_published = false;
};

struct ApproximationFit {
  const ApproximationRow* row = nullptr;
  double each_value = 0.0;
  std::vector<RefittedConstant> constants;  // all of the form's
  FormScore published, refit;
  std::vector<FormScore> rivals;
  std::vector<FormReading> readings;  // none where nothing is published; nearest first
  struct Integral {
    double target, published, refit;
  };
  std::optional<Integral> integral;

  std::vector<double> values() const;
};

struct ApproximationResult {
  std::vector<ApproximationFit> fits;
  std::string conclusion;

  Json json(const ApproximationRecipe& recipe, const std::string& command) const;
};

/// Least squares by Ceres; for the largest error, of powers of the residuals that rise. Intervals (95 %) are by a
/// jackknife over ten blocks of the first axis: how far constants move with the domain. Ignores noise, for there is
/// none.
ApproximationResult run_approximations(const ApproximationRecipe& recipe, Monitor& monitor);

/// Every point of a row's domain, as arguments of the target.
std::vector<std::vector<double>> domain_points(const ApproximationRow& row, const FormDomain& domain,
                                               double each_value);
/// The form's arguments at a point.
std::vector<double> form_arguments(const Form& form, const Target& target, const std::vector<double>& point);

}  // namespace lobefit
