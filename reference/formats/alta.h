// ALTA text: a list of directions and values under a header of `#NAME value` lines.
//
// #DIM inputs outputs, #PARAM_IN, #PARAM_OUT, #VS (columns of uncertainty after the values: 0, 1 or 2 per output).
// Read: ISOTROPIC_TL_TV_PROJ_DPHI, ISOTROPIC_TV_TL_DPHI, RUSIN_TH_TD_PD, SPHERICAL_TL_PL_TV_PV and CARTESIAN (view
// first), angles in radians, azimuth difference 0 on the retro side; INV_STERADIAN, or INV_STERADIAN_COSINE_FACTOR
// (times the cosine of the view), with one or three outputs.
#pragma once

#include <string>
#include <string_view>

#include "reference/table.h"

namespace lobefit {

struct Alta {
  static bool recognise(std::string_view text);
  /// Throws Error(invalid_input) with the line. Rows under the surface are masked.
  static Table parse(std::string_view text, const std::string& place);
  /// One parameter row's valid entries: RUSIN_TH_TD_PD for Rusinkiewicz coordinates, else ISOTROPIC_TV_TL_DPHI for
  /// spherical ones and SPHERICAL_TL_PL_TV_PV for lists. Throws Error(usage) for several rows.
  static std::string text(const Table& table);
};

/// One line per valid entry: parameter axes, theta_i, phi_i, theta_o, phi_o in degrees, then f or r, g, b.
std::string table_csv(const Table& table);

}  // namespace lobefit
