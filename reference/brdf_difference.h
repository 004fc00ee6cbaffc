// How far two BRDFs are apart, in every measure that is taken on the BRDF itself.
//
//   const BrdfDifference difference = brdf_difference({.table = &truth, .values = rendered.values});
//   difference.rms[static_cast<std::size_t>(Quantity::log)].solid_angle
//
// "Truth" is the table, "other" what is held against it; swapped, everything but what is relative stays the same. All
// means divide by the sum of their weights, so that figures do not depend on the size of the grid.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "reference/albedo_difference.h"
#include "reference/metric.h"

namespace lobefit {

/// One mean over the entries, all alike, and one over solid angle: d omega_i d omega_o by the table's own quadrature.
/// The latter is absent where no entry has any, as on a slice of normal views.
struct EntryMean {
  double uniform = 0.0;
  std::optional<double> solid_angle;
};

/// ∫∫ |f - g| cos theta_i cos theta_o dω_i dω_o in units where a Lambertian surface has π albedo, and its share of
/// ∫∫ f cos theta_i cos theta_o dω_i dω_o.
struct BihemisphericalDifference {
  double absolute;
  std::optional<double> relative;
};

/// What could not be had, and why.
struct NotFormed {
  std::string metric, reason;
};

struct BrdfDifference {
  std::size_t entries = 0;                           // that were compared
  std::array<EntryMean, quantity_names.size()> rms;  // by Quantity: root of the mean square difference
  EntryMean mean_absolute_log;                       // mean |log(1 + f c) - log(1 + g c)|, c = cos theta_i
  EntryMean smape;                                   // mean |f - g| / (|f| + |g|), 0 where both vanish: from 0 to 1
  std::optional<BihemisphericalDifference> bihemispherical;
  std::optional<AlbedoDifference> albedo;
  std::vector<NotFormed> not_formed;

  /// `a` is the truth, `b` the other; null is what was not formed.
  Json json(const Table& table) const;
};

/// Channels count alike. Throws Error(invalid_input) if every entry is masked.
BrdfDifference brdf_difference(const BrdfPair& pair);

/// Why a table has no hemispheres to integrate over, if it has none: a fibre's, or one that reaches below the horizon.
std::optional<std::string> no_hemisphere(const Table& table);

/// Values of a table's parameter axes in one row, by name.
Json row_json(const Table& table, std::size_t row);

}  // namespace lobefit
