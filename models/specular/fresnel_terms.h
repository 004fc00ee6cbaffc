// Fresnel terms, registered.
#pragma once

#include "models/microfacet/fresnel.h"
#include "models/specular/term.h"

namespace lobefit {

inline constexpr ParameterInfo dielectric_eta_parameter{.name = "eta",
                                                        .symbol = "η",
                                                        .lower = 0.25,
                                                        .upper = 4.0,
                                                        .initial = 1.5,
                                                        .doc = "Index beyond the interface over that on this side."};
inline constexpr ParameterInfo conductor_eta_parameter{
    .name = "eta", .symbol = "η", .lower = 0.01, .upper = 8.0, .initial = 1.5, .doc = "Real part of the index."};
inline constexpr ParameterInfo conductor_k_parameter{
    .name = "k", .symbol = "k", .upper = 12.0, .initial = 2.0, .doc = "Imaginary part of the index: absorption."};
inline constexpr ParameterInfo callisto_falloff_parameter{
    .name = "n_s", .symbol = "n_s", .initial = 0.5, .doc = "Specular Fresnel falloff; 1/2 is Schlick."};

using FNone = Term<ConstantFresnel, term_f0_parameter>;
using FSchlick = Term<SchlickFresnel, term_f0_parameter, term_f90_parameter>;
using FCookTorrance = Term<CookTorranceFresnel, term_f0_parameter>;
using FDielectric = Term<DielectricFresnel, dielectric_eta_parameter>;
using FConductor = Term<ConductorFresnel, conductor_eta_parameter, conductor_k_parameter>;
using FCallisto = Term<CallistoFresnel, term_f0_parameter, callisto_falloff_parameter>;
using FUnreal = Term<UnrealFresnel, term_f0_parameter>;

}  // namespace lobefit
