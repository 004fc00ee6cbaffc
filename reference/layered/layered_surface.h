// Ground truth for plane-parallel layers: position-free Monte Carlo (Guo, Hašan, Zhao 2018, Position-Free Monte Carlo
// Simulation for Arbitrary Layered BSDFs).
//
// Layers are wide and uniform, so a path is its directions and depths alone. In radiance divided by n², with directions
// measured by dm = n² |cos θ| dω, which refraction leaves alone,
//
//   f(wi, wo) = Σ_N ∫ Π_j k_j(ω_{j-1}, ω_j) Π exp(-Δτ_j / |cos θ_j|) dm_1 … dm_{N-1} dτ …,   ω_0 = wo, ω_N = wi,
//
// where the kernel k of a boundary is its BSDF over n² of the side the light comes from, and that of a medium is
// albedo × phase / (n² |cos θ| |cos θ'|). All kernels are symmetric, and so is f: it is reciprocal.
//
// A path from the eye and one from the light are sampled; every vertex of the first is joined to every straight flight
// of the second, which is next-event estimation through as many interfaces as the light's path has crossed. All ways to
// make the same path are weighted by the balance heuristic (Veach 1997). The weights may use densities other than those
// sampled, as they must for the walks of interfaces with all bounces (rough_interface.h): they sum to 1 all the same.
// Smooth interfaces, mirrors among them, are crossed by both paths, reflecting or refracting by chance.
//
// f has no delta components: paths of smooth interfaces alone, such as the mirror image in a smooth coat, are left out.
// Paths that scatter at least once, and pass any number of smooth interfaces before and after, are in.
//
// Channels: albedos may differ along one path, which carries their weights. Where mean free paths differ, red, green
// and blue have paths of their own, from the same numbers.
// Coverage: every event of positive probability is estimated with all samples and weighted exactly.
#pragma once

#include <memory>

#include "reference/integrator.h"
#include "reference/layered/layer_stack.h"

namespace lobefit {

class LayeredSurface : public Integrator {
 public:
  explicit LayeredSurface(const LayerStack& stack);
  ~LayeredSurface() override;

  int channels() const override { return channels_; }
  /// Lights of a line share the eye's paths, and those of equal polar angle the light's, turned about the normal. A
  /// light's value does not depend on what else is in its line. `fast` changes nothing.
  void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points, std::uint32_t samples,
                  bool fast, const Line& line) const override;

  /// Mean share of the light that leaves upwards, mirror images included, were `wo` where it comes from: the
  /// directional albedo, by the paths from the eye alone.
  Rgb sample_albedo(const Direction& wo, const SamplePoints& points, std::uint32_t samples) const;

 private:
  struct Scene;
  class Estimator;

  std::vector<Scene> scenes_;
  int channels_ = 1;
};

std::unique_ptr<const Integrator> make_layered(const LayerStack& stack);

}  // namespace lobefit
