// What Unreal's hair makes of a colour: how much of the light a path through the fibre leaves.
#pragma once

#include "models/model.h"

namespace lobefit {

/// Transmittance per channel: color^linear exp(-quadratic ln² color).
struct HairTransmittance {
  static constexpr const char* name = "hair_absorption";
  static constexpr std::array arguments{"color", "linear_part", "quadratic_part"};

  template <class V, class E, class Q>
  LOBEFIT_TEXT static auto evaluate(const V& color, const E& linear, const Q& quadratic) {
    const auto l = let("l", V{log(color.x), log(color.y), log(color.z)});
    const auto exponent = let("exponent", l * (linear - quadratic * l));
    return V{exp(exponent.x), exp(exponent.y), exp(exponent.z)};
  }
};

/// HairColorToAbsorption, which S3 calls and does not define: σ = (ln C/D(b))², with Chiang et al. 2016's D, a fit of
/// the colour of a whole head of hair over the azimuthal roughness b. Its coefficients are no parameters here: only the
/// number D enters, and b moves it.
struct ChiangAbsorptionScale {
  static constexpr const char* name = "chiang_absorption_scale";
  static constexpr std::array arguments{"b"};

  template <class B>
  LOBEFIT_TEXT static constexpr auto evaluate(const B& b) {
    return 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
  }
};

}  // namespace lobefit
