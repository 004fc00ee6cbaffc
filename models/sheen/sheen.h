// What the sheen models share: parameters, and sampling by the cosine, for lobes that cover the whole hemisphere.
#pragma once

#include "models/model.h"
#include "models/sampling.h"

namespace lobefit {

inline constexpr ParameterInfo sheen_color_parameter{
    .name = "color", .symbol = "C", .initial = 1.0, .doc = "Scales the lobe, linear Rec.709 RGB."};

struct CosineSampling {
  template <class P>
  static Direction sample(const P&, const Direction&, const std::array<double, 2>& u) {
    return sample_cosine(u);
  }
  template <class P>
  static double pdf(const P&, const Direction& wi, const Direction&) {
    return cosine_density(wi);
  }
};

}  // namespace lobefit
