// Shader text of the rules that make one slab of two (models/substrate/blend.h).
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "models/substrate/blend.h"

namespace lobefit {

/// FittedBlend with its constants in one struct, as functions on the parameter struct of the exported model `slab`;
/// both texts may stand in one shader (in WGSL what both define is to be taken out of one):
///
///   Lobefit_slab_Parameters Lobefit_BlendVertical(top, bottom, cos_theta_o)
///   Lobefit_slab_Parameters Lobefit_BlendHorizontal(background, foreground, foreground_share, cos_theta_o)
///
/// and the same as …VerticalHaze and …HorizontalHaze, which keep two lobes. `provenance` are the lines of the head
/// comment. Throws Error(usage) for an unknown language.
std::string blend_shader(std::string_view language, const FittedBlend::Constants<double>& constants,
                         std::span<const std::string> provenance);

}  // namespace lobefit
