#include "evaluate/conditioning.h"

#include <cmath>
#include <limits>
#include <vector>

namespace lobefit {

std::array<double, 3> float_conditioning(const Model& model, std::span<const double> flat, Direction wi, Direction wo) {
  std::vector<double> inputs(flat.begin(), flat.end());
  const Rgb here = model.evaluate(inputs, wi, wo);
  std::array<double, 3> sum{};
  const auto add = [&](double& input) {
    const double kept = input;
    input *= 1.0 + static_cast<double>(std::numeric_limits<float>::epsilon());
    const Rgb there = model.evaluate(inputs, wi, wo);
    sum[0] += 2.0 * std::abs(there.x - here.x);
    sum[1] += 2.0 * std::abs(there.y - here.y);
    sum[2] += 2.0 * std::abs(there.z - here.z);
    input = kept;
  };
  for (double& value : inputs) add(value);
  for (Direction* w : {&wi, &wo}) add(w->x), add(w->y), add(w->z);
  return sum;
}

}  // namespace lobefit
