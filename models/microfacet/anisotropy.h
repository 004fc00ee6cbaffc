// From one alpha and an anisotropy to alpha_x and alpha_y (S4). Published mappings disagree; each is a text.
#pragma once

#include "models/scalar.h"

namespace lobefit {

template <class T>
struct AlphaPair {
  T x, y;
};

/// αx = α, αy = lerp(0, α, 1 - a); a in [0, 1]. At a = 1 the lobe is a line, which is no BRDF.
struct NeubeltPettineoAnisotropy {
  template <class T>
  LOBEFIT_TEXT static AlphaPair<T> evaluate(const T& alpha, const T& anisotropy) {
    return {alpha, let("alpha_y", alpha * (1.0 - anisotropy))};
  }
};

/// αx = α/√(1 - .9a), αy = α √(1 - .9a); a in [0, 1]. Keeps αx αy, hence the peak; αx grows to 3.2 α. (Burley 2012)
struct BurleyAnisotropy {
  template <class T>
  LOBEFIT_TEXT static AlphaPair<T> evaluate(const T& alpha, const T& anisotropy) {
    const T aspect = let("aspect", sqrt(1.0 - 0.9 * anisotropy));
    return {let("alpha_x", alpha / aspect), let("alpha_y", alpha * aspect)};
  }
};

/// αx = α (1 + a), αy = α (1 - a); a in [-1, 1]: -a turns the surface by 90°. (Kulla, Conty 2017; Substrate)
struct KullaContyAnisotropy {
  template <class T>
  LOBEFIT_TEXT static AlphaPair<T> evaluate(const T& alpha, const T& anisotropy) {
    return {let("alpha_x", alpha * (1.0 + anisotropy)), let("alpha_y", alpha * (1.0 - anisotropy))};
  }
};

}  // namespace lobefit
