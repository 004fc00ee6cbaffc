// Substrate trees for people: as text and as a picture.
#pragma once

#include <string>

#include "models/substrate/tree.h"

namespace lobefit {

/// A line per node with its operator and amount or, of a slab, the parameters that are not neutral. In brackets the
/// statistics of the walk: coverage C, and transmittance T along the normal of what is there. What a selection left out
/// has none. Thicknesses are those that vertical operators have set; the lowest slabs of a tree that is not thin are
/// opaque.
std::string tree_text(const SlabTree& tree);

/// The same as an SVG document, with swatches of each slab's diffuse albedo, F0 and transmittance (sRGB).
std::string tree_svg(const SlabTree& tree, const std::string& title = "");

}  // namespace lobefit
