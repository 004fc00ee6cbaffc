// Every closed form with constants to refit.
#pragma once

#include "models/approximations/albedo.h"
#include "models/approximations/hair.h"
#include "models/approximations/specular.h"

namespace lobefit {

using ApproximationForms =
    decltype(std::tuple_cat(std::declval<HairForms>(), std::declval<SpecularForms>(), std::declval<AlbedoForms>()));

}  // namespace lobefit
