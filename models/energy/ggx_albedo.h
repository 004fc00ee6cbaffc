// How much light one bounce between GGX mirrors returns: E(μ, α) for F = 1, height-correlated Smith masking. Energy
// compensation is made of it (compensation.h).
//
// The table is our own integral. Two published fits stand in models/approximations/albedo.h. Errors against the
// integral, evenly over √μ and √α (tests/energy_test.cpp prints them), at worst and rms:
//
//               F = 1             f0 = .04
//   table       4.4e-4, 7.4e-5
//   MaterialX   .12, .019         .046, .006
//   Karis       .54, .18          .083, .036
//
// Karis's is made for Unreal's k = α/2 masking, which returns less at grazing angles; from that it differs by .08 rms.
#pragma once

#include "models/energy/ggx_albedo_entries.h"
#include "models/lookup.h"
#include "models/microfacet/normal_distribution.h"

namespace lobefit {

/// (1 - E) ((μ + c)/c)², c = 3 α, over u = √(μ (1 + c)/(μ + c)) and v = √α. Light is lost at grazing angles μ ~ α above
/// all, and like (α/μ)² beyond: these coordinates resolve that at every roughness, and the factor keeps the little that
/// is lost elsewhere to a few digits.
struct GgxAlbedoLossTable {
  static constexpr const char* name = "ggx_albedo_loss_table";
  static constexpr int columns = ggx_loss_columns, rows = ggx_loss_rows;
  static constexpr auto entries = ggx_loss_entries;
};
/// 2 ∫ (1 - E) μ dμ / α² over ∜α, E as GgxAlbedoLossTable gives it: what is compensated is what that table has lost.
struct GgxAverageLossTable {
  static constexpr const char* name = "ggx_average_loss_table";
  static constexpr int columns = ggx_average_columns;
  static constexpr auto entries = ggx_average_entries;
};
/// Mean of (1 - V·H)⁵ over the reflected light, over √μ and √α: E_F = E (f0 + (f90 - f0) weight) for Schlick's Fresnel.
struct GgxSchlickWeightTable {
  static constexpr const char* name = "ggx_schlick_weight_table";
  static constexpr int columns = ggx_weight_columns, rows = ggx_weight_rows;
  static constexpr auto entries = ggx_weight_entries;
};

/// 1 - E, by the table.
struct GgxAlbedoLoss {
  static constexpr const char* name = "ggx_albedo_loss";
  static constexpr std::array arguments{"cos_theta", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static T evaluate(const G& cos_theta, const T& alpha) {
    const T a = let("a", max(alpha, smallest_alpha));
    const T c = let("c", 3.0 * a);
    const T sum = let("sum", max(cos_theta, 0.0) + c);
    const T u = let("u", sqrt(max(cos_theta, 0.0) * (1.0 + c) / sum));
    const T scale = let("scale", c / sum);
    return max(scale * scale * lookup<GgxAlbedoLossTable>(u, T(sqrt(a))), 0.0);
  }
};

/// 1 - E_avg, E_avg = 2 ∫ E μ dμ, by the table.
struct GgxAverageLoss {
  static constexpr const char* name = "ggx_average_loss";
  static constexpr std::array arguments{"alpha"};

  template <class T>
  LOBEFIT_TEXT static T evaluate(const T& alpha) {
    const T a = let("a", max(alpha, smallest_alpha));
    return a * a * lookup<GgxAverageLossTable>(T(sqrt(sqrt(a))));
  }
};

/// See GgxSchlickWeightTable; to 0.01 at worst, next to grazing mirrors, 8e-4 rms.
struct GgxSchlickWeight {
  static constexpr const char* name = "ggx_schlick_weight";
  static constexpr std::array arguments{"cos_theta", "alpha"};

  template <class G, class T>
  LOBEFIT_TEXT static T evaluate(const G& cos_theta, const T& alpha) {
    return saturate(lookup<GgxSchlickWeightTable>(T(sqrt(cos_theta)), T(sqrt(alpha))));
  }
};

}  // namespace lobefit
