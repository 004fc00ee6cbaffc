// How a slab's medium is shaded: by its mean free path, what lies on the slab's other side, and the size of a pixel
// (S2, slides 26-31).
#pragma once

#include "models/substrate/tree.h"

namespace lobefit {

enum class Regime { opaque_diffuse, optically_thick, optically_thin, translucent };
inline constexpr std::array<std::string_view, 4> regime_names{"opaque diffuse", "optically thick", "optically thin",
                                                              "translucent"};

/// `lowest`: nothing but the geometry lies below. `pixel_footprint`, cm: the width that a pixel covers.
///
/// A lowest slab, or one that lets less than a thousandth through, is opaque where light comes out again within the
/// pixel, its mean free path being shorter, else optically thick: light spreads under the surface, which no BRDF shows
/// (engines blur it in screen space, or wrap the cosine). Other slabs are thin where they scatter, else translucent.
inline Regime regime_of(const SlabValues& slab, bool lowest, double pixel_footprint) {
  const Rgb passed = medium_transmittance(slab);
  if (lowest || largest_channel(passed) < 1e-3) {
    return largest_channel(slab.mean_free_path) <= pixel_footprint ? Regime::opaque_diffuse : Regime::optically_thick;
  }
  return largest_channel(slab.diffuse_albedo) > 0.0 ? Regime::optically_thin : Regime::translucent;
}

struct SlabRegime {
  std::string name;  // the slab's, or its path
  Regime regime;
};

/// Of every slab of a tree, operands before operators.
inline std::vector<SlabRegime> regimes_of(const SlabTree& given, double pixel_footprint) {
  // resolved() makes the lowest slabs opaque; how far light spreads in them is what they say themselves.
  SlabTree thin = given;
  thin.thin = true;
  const SlabTree tree = resolved(given), own = resolved(thin);
  std::vector<SlabRegime> regimes;
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const TreeNode& node = tree.nodes[i];
    if (node.kind != Operator::slab) continue;
    regimes.push_back({node.name.empty() ? node.path : node.name,
                       regime_of(own.nodes[i].slab, is_opaque(node.slab), pixel_footprint)});
  }
  return regimes;
}

}  // namespace lobefit
