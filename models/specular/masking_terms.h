// Masking-shadowing functions and visibilities as registered terms.
#pragma once

#include "models/microfacet/masking.h"
#include "models/specular/term.h"

namespace lobefit {

using GImplicit = Term<ImplicitMasking>;
using GNeumann = Term<NeumannMasking>;
using GCookTorrance = Term<CookTorranceMasking>;
using GKelemen = Term<KelemenMasking>;
using GSmithBeckmann = Term<SmithBeckmannMasking, specular_alpha_parameter>;
using GSmithGgx = Term<SmithGgxMasking, specular_alpha_parameter>;
using GSchlickBeckmann = Term<SchlickBeckmannMasking, specular_alpha_parameter>;
using GSchlickGgx = Term<SchlickGgxMasking, specular_alpha_parameter>;
using GSmithGgxCorrelated = Term<SmithGgxCorrelatedMasking, specular_alpha_parameter>;
using VisSmithJointApprox = Term<SmithJointApproximation, specular_alpha_parameter>;
using VisCloth = Term<ClothVisibility>;

}  // namespace lobefit
