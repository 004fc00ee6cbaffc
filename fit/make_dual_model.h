// From a model's text to its values and derivatives.
#pragma once

#include <vector>

#include "fit/dual_model.h"
#include "models/instruction_sets.h"

namespace lobefit {

// Each translation unit has its own: GCC's clones of a template need internal linkage.
namespace {

template <class M>
LOBEFIT_CLONES [[gnu::noinline]] void differentiate_chunk(const typename M::template Parameters<Dual<dual_width>>& p,
                                                          const Direction* wi, const Direction* wo, std::size_t n,
                                                          int channels, double* values, double* derivatives) {
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3<Dual<dual_width>> f = evaluate_brdf<M>(p, wi[i], wo[i]);
    const Dual<dual_width>* const components[3] = {&f.x, &f.y, &f.z};
    for (std::size_t c = 0; c < static_cast<std::size_t>(channels); ++c) {
      values[c * n + i] = components[c]->value;
      double* row = derivatives + (c * n + i) * dual_width;
      for (std::size_t k = 0; k < dual_width; ++k) row[k] = components[c]->derivative[k];
    }
  }
}

}  // namespace

/// `M` as fits differentiate it:
///
///   add_dual_model(make_dual_model<MyModel>());   // after add_model()
template <class M>
DualModel make_dual_model() {
  return {.name = M::info.name,
          .evaluate = [](std::span<const double> flat, std::span<const int> variable_of_slot, int first,
                         std::span<const Direction> wi, std::span<const Direction> wo, int channels, double* values,
                         double* derivatives) {
            using D = Dual<dual_width>;
            std::vector<D> slots(flat.begin(), flat.end());
            for (std::size_t s = 0; s < slots.size(); ++s) {
              const int k = variable_of_slot[s] - first;
              if (variable_of_slot[s] >= 0 && k >= 0 && k < dual_width) slots[s] = D::variable(flat[s], k);
            }
            differentiate_chunk<M>(unflatten<M, D>(std::span<const D>(slots)), wi.data(), wo.data(), wi.size(),
                                   channels, values, derivatives);
          }};
}

}  // namespace lobefit
