// The distributions as registered terms.
#pragma once

#include "models/microfacet/normal_distribution.h"
#include "models/specular/term.h"

namespace lobefit {

using DBlinnPhong = Term<BlinnPhongDistribution, specular_alpha_parameter>;
using DBeckmann = Term<BeckmannDistribution, specular_alpha_parameter>;
using DGgx = Term<GgxDistribution, specular_alpha_parameter>;
using DGtr1 = Term<Gtr1Distribution, specular_alpha_parameter>;
using DBeckmannAnisotropic =
    Term<BeckmannAnisotropicDistribution, specular_alpha_x_parameter, specular_alpha_y_parameter>;
using DGgxAnisotropic = Term<GgxAnisotropicDistribution, specular_alpha_x_parameter, specular_alpha_y_parameter>;
using DCharlie = Term<CharlieDistribution, specular_alpha_parameter>;
using DAshikhmin = Term<AshikhminDistribution, specular_alpha_parameter>;
using DAshikhminApprox = Term<AshikhminApproximation, specular_alpha_parameter>;

}  // namespace lobefit
