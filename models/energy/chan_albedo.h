// What Chan's 2018 diffuse keeps of the light: its directional albedo at albedo 1.
#pragma once

#include "models/energy/chan_albedo_entries.h"
#include "models/lookup.h"

namespace lobefit {

/// Over μ and roughness, by our own quadrature (scripts/chan_albedo_table); to .012 at worst, .0021 rms between the
/// entries (tests/substrate_rules_test.cpp).
struct ChanAlbedoTable {
  static constexpr const char* name = "chan_albedo_table";
  static constexpr int columns = chan_albedo_columns, rows = chan_albedo_rows;
  static constexpr auto entries = chan_albedo_entries;
};

struct ChanAlbedo {
  static constexpr const char* name = "chan_albedo";
  static constexpr std::array arguments{"cos_theta", "roughness"};

  template <class G, class T>
  LOBEFIT_TEXT static T evaluate(const G& cos_theta, const T& roughness) {
    return lookup<ChanAlbedoTable>(T(cos_theta), roughness);
  }
};

}  // namespace lobefit
