// Pairs of Substrate slabs drawn from stated distributions, and what they look like: what rules for collapsing
// operators are fitted to and judged by.
#pragma once

#include <cstdint>
#include <vector>

#include "models/substrate/walk.h"
#include "reference/integrator.h"
#include "reference/table.h"

namespace lobefit {

/// A coat and what it lies on.
///
/// Top: with probability .85 an interface of index 1.3 to 1.7, smooth in a third of the cases, else of perceptual
/// roughness .1 to .7; else none. Medium: clear, absorbing (each channel lets .2 to 1 through) or scattering (optical
/// depth .1 to 3, diffuse albedo .1 to .95 by channel, g -.2 to .8) in equal shares; without an interface it scatters.
/// Bottom: diffuse (albedo .02 to .95 by channel; F0 0 or .04) or a conductor (F0 .4 to 1 by channel), half each, of
/// roughness .1 to 1. All uniform, independent.
struct LayeredPair {
  enum class Medium { clear, absorbing, scattering };
  SlabValues top{}, bottom{};
  bool conductor = false, smooth = false;
  Medium medium = Medium::clear;

  static LayeredPair draw(std::uint64_t seed, std::uint32_t number);
  SlabTree tree() const;
};
inline constexpr std::array<std::string_view, 3> pair_medium_names{"clear", "absorbing", "scattering"};

/// Two opaque slabs and how they are mixed: each a bottom of LayeredPair's distribution or a dielectric of F0 .02 to
/// .08; mix .05 to .95. What they look like is known: the mix of both.
struct MixedPair {
  SlabValues background{}, foreground{};
  double mix = 0.5;

  static MixedPair draw(std::uint64_t seed, std::uint32_t number);
  SlabTree tree() const;
};

/// The directions in which pairs are looked at: views from 2° to 75° (not quite the normal, where every light would
/// meet the same facets), lights over the half circle.
Grid pair_grid();
/// Views alone, for directional albedos.
Grid pair_views();

/// LayeredPair number `pair` of `pairs_seed`, by the layered integrator: BRDFs, and directional albedos (in place of
/// BRDFs, whatever the light; mirror images included). render() makes tables of them over an axis `pair`.
Reference layered_pair_reference();
Reference layered_pair_albedo_reference();

}  // namespace lobefit
