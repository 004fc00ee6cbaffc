// Unreal's older shading models as slabs (S2: "legacy materials are converted"; the rules are ours, where S2 is
// silent).
//
//   default_lit          one slab: metalness to diffuse albedo and F0
//   clear_coat           a colourless film of F0 .04 on part of it
//   cloth                fuzz on it
//   subsurface, two_sided_foliage, preintegrated_skin
//                        a body of base colour plus what the model's own subsurface term sends back, both as means over
//                        all views; a mean free path that lets pass what the term sends through, for thin trees
//   subsurface_profile   two lobes; the profile's blur on the screen is no part of a BRDF
//   eye                  the cornea's lobe over the body; the tilted iris and its caustic are left out
//
// Lobes are the slab's own (exact masking, energy compensation), bodies Chan's diffuse.
#pragma once

#include <tuple>

#include "models/substrate/tree.h"
#include "models/unreal/clear_coat.h"
#include "models/unreal/cloth.h"
#include "models/unreal/eye.h"
#include "models/unreal/preintegrated_skin.h"
#include "models/unreal/subsurface.h"
#include "models/unreal/subsurface_profile.h"
#include "models/unreal/two_sided_foliage.h"

namespace lobefit {

using UnrealSlabModels = std::tuple<UnrealDefaultLit, UnrealClearCoat, UnrealCloth, UnrealSubsurface,
                                    UnrealTwoSidedFoliage, UnrealPreintegratedSkin, UnrealSubsurfaceProfile, UnrealEye>;

/// A model's name in trees: without "unreal_".
template <class M>
inline constexpr std::string_view unreal_slab_name = M::info.name.substr(std::string_view("unreal_").size());

/// Each adds its nodes and returns the one to use.
int add_unreal_slabs(SlabTree& tree, const UnrealDefaultLit::Parameters<double>& pins);
int add_unreal_slabs(SlabTree& tree, const UnrealClearCoat::Parameters<double>& pins);
int add_unreal_slabs(SlabTree& tree, const UnrealCloth::Parameters<double>& pins);
int add_unreal_slabs(SlabTree& tree, const UnrealSubsurface::Parameters<double>& pins);
int add_unreal_slabs(SlabTree& tree, const UnrealTwoSidedFoliage::Parameters<double>& pins);
int add_unreal_slabs(SlabTree& tree, const UnrealPreintegratedSkin::Parameters<double>& pins);
int add_unreal_slabs(SlabTree& tree, const UnrealSubsurfaceProfile::Parameters<double>& pins);
int add_unreal_slabs(SlabTree& tree, const UnrealEye::Parameters<double>& pins);

/// What a transmitting model's subsurface term, its surface being black and without gloss, sends back and through:
/// albedos under light from all sides, by midpoints; within 1e-3.
struct ScatteredShares {
  Rgb back{0.0, 0.0, 0.0}, through{0.0, 0.0, 0.0};
};

template <class M>
ScatteredShares scattered_shares(typename M::template Parameters<double> pins) {
  constexpr int steps = 24;
  pins.base_color = {0.0, 0.0, 0.0};
  pins.metallic = pins.specular = 0.0;
  ScatteredShares shares;
  for (int view = 0; view < steps; ++view) {
    // Midpoints in cosine squared: the mean over views of uniform radiance.
    const double mu_o = std::sqrt((view + 0.5) / steps);
    const Direction wo{std::sqrt(1.0 - mu_o * mu_o), 0.0, mu_o};
    for (int light = 0; light < 2 * steps; ++light) {
      const double mu_i = (light + 0.5) / steps - 1.0, sine = std::sqrt(1.0 - mu_i * mu_i);
      for (int turn = 0; turn < steps; ++turn) {
        const double phi = pi * (turn + 0.5) / steps;
        const Direction wi{sine * std::cos(phi), sine * std::sin(phi), mu_i};
        const Rgb sent = evaluate_brdf<M, double>(pins, wi, wo) * (std::abs(mu_i) * 2.0 * pi / (steps * steps * steps));
        (mu_i > 0.0 ? shares.back : shares.through) = (mu_i > 0.0 ? shares.back : shares.through) + sent;
      }
    }
  }
  return shares;
}

}  // namespace lobefit
