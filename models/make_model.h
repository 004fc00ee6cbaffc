// From a model's text to what the double-precision rooms know of it.
#pragma once

#include "models/registry.h"

namespace lobefit {

/// `M` in double precision:
///
///   add_model(make_model<MyModel>());   // and find_model("my_model") knows it
template <class M>
Model make_model() {
  Model model{.info = &M::info,
              .parameters = describe_parameters<M>(),
              .evaluate = [](std::span<const double> flat, const Direction& wi,
                             const Direction& wo) { return evaluate_brdf<M>(unflatten<M, double>(flat), wi, wo); },
              .evaluate_all =
                  [](std::span<const double> flat, std::span<const Direction> wi, std::span<const Direction> wo,
                     std::span<Rgb> values) {
                    const auto p = unflatten<M, double>(flat);
                    for (std::size_t i = 0; i < values.size(); ++i) values[i] = evaluate_brdf<M>(p, wi[i], wo[i]);
                  }};
  using P = typename M::template Parameters<double>;
  if constexpr (requires(const P& p, const Direction& wo, const std::array<double, 2>& u) { M::sample(p, wo, u); }) {
    model.sample = [](std::span<const double> flat, const Direction& wo, const std::array<double, 2>& u) {
      return M::sample(unflatten<M, double>(flat), wo, u);
    };
    model.pdf = [](std::span<const double> flat, const Direction& wi, const Direction& wo) {
      return M::pdf(unflatten<M, double>(flat), wi, wo);
    };
  }
  return model;
}

}  // namespace lobefit
