#include "reference/substrate/tree_albedo.h"

namespace lobefit {

namespace {

/// Van der Corput's sequence: the bits of `i` behind the point, in reverse.
double radical_inverse(std::uint32_t i) {
  double value = 0.0;
  for (double digit = 0.5; i != 0; i >>= 1, digit *= 0.5) value += digit * (i & 1u);
  return value;
}

}  // namespace

// Hammersley's points: their first number decides the lobe, and each lobe gets its share of them to one point, spread
// well by the second. On a square grid lobes would get whole columns.
std::vector<Rgb> closure_albedos(const std::vector<Closure>& closures, const Direction& wo, int steps) {
  std::vector<Rgb> albedos(closures.size(), Rgb{0.0, 0.0, 0.0});
  const auto count = static_cast<std::uint32_t>(steps * steps);
  const double weight = 1.0 / count;
  for (std::size_t k = 0; k < closures.size(); ++k) {
    for (std::uint32_t i = 0; i < count; ++i) {
      const Direction wi = Slab::sample(closures[k].slab, wo, {(i + 0.5) * weight, radical_inverse(i)});
      if (wi.z <= 0.0) continue;
      const double density = Slab::pdf(closures[k].slab, wi, wo);
      if (density <= 0.0) continue;
      albedos[k] = albedos[k] + closures[k].evaluate(wi, wo) * (wi.z * weight / density);
    }
  }
  return albedos;
}

Rgb directional_albedo(const std::vector<Closure>& closures, const Direction& wo, int steps) {
  Rgb sum{0.0, 0.0, 0.0};
  for (const Rgb& albedo : closure_albedos(closures, wo, steps)) sum = sum + albedo;
  return sum;
}

ClosureSelection ClosureSelection::of(const std::vector<Closure>& closures, const Direction& wo, int steps) {
  ClosureSelection selection;
  double sum = 0.0;
  for (const Rgb& albedo : closure_albedos(closures, wo, steps)) {
    selection.probabilities.push_back(mean_channel(albedo));
    sum += selection.probabilities.back();
  }
  for (double& probability : selection.probabilities) {
    probability = sum > 0.0 ? probability / sum : 1.0 / static_cast<double>(closures.size());
  }
  return selection;
}

std::size_t ClosureSelection::choose(double u) const {
  std::size_t chosen = 0;
  while (chosen + 1 < probabilities.size() && u >= probabilities[chosen]) u -= probabilities[chosen++];
  return chosen;
}

Rgb ClosureSelection::variance(const std::vector<Closure>& closures, const Direction& wi, const Direction& wo) const {
  Rgb squares{0.0, 0.0, 0.0}, sum{0.0, 0.0, 0.0};
  for (std::size_t k = 0; k < closures.size(); ++k) {
    const Rgb f = closures[k].evaluate(wi, wo);
    sum = sum + f;
    if (probabilities[k] > 0.0) squares = squares + f * f * (1.0 / probabilities[k]);
  }
  return squares - sum * sum;
}

}  // namespace lobefit
