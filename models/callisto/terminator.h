// Callisto's c2: the smooth terminator.
#pragma once

#include "models/model.h"

namespace lobefit {

/// α_s = (1 - (1 - cos θ_d)³)(1 - (1 - cos θ_h)³): keeps the terminator away from where c1 acts. Source: Jimenez et al.
/// 2023, slide 90; as printed it has the angles themselves in the place of their cosines, which would make it negative.
struct CallistoTerminatorMask {
  static constexpr const char* name = "callisto_terminator_mask";
  static constexpr std::array arguments{"cos_theta_d", "cos_theta_h"};

  template <class G>
  LOBEFIT_TEXT static auto evaluate(const G& cos_theta_d, const G& cos_theta_h) {
    // 1 - (1 - x)³ = x (3 - x (3 - x)), which keeps its digits next to x = 0.
    return cos_theta_d * (3.0 - cos_theta_d * (3.0 - cos_theta_d)) *
           (cos_theta_h * (3.0 - cos_theta_h * (3.0 - cos_theta_h)));
  }
};

/// smoothstep(0, edge, x), 1 where the edge vanishes.
struct CallistoSmoothEdge {
  static constexpr const char* name = "callisto_smooth_edge";
  static constexpr std::array arguments{"edge", "x"};

  template <class T, class G>
  LOBEFIT_TEXT static auto evaluate(const T& edge, const G& x) {
    const auto t = let("t", saturate(x / max(edge, smallest_base)));
    return t * t * (3.0 - 2.0 * t);
  }
};

}  // namespace lobefit
