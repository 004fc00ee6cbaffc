// From a tree to closures: coverage and transmittance statistics, and what each slab loses to those above it (S2,
// slides 44-56 and bonus slides).
//
// The statistics take coverages of different slabs for independent. As printed, the transmittance of two layers is a
// sum over the covered events, T C; nested operators need T, that of what is there, or else layering is not
// associative: over three slabs we found .369 both ways with T and .295 or .305 with T C.
//
// Left out by the slides, and so by the walk: light that bounces between layers, reflection at the inside of an
// interface, and the light's loss at the interface on its way in (the view's is counted).
#pragma once

#include "models/substrate/tree.h"

namespace lobefit {

/// Any number of slabs seen from outside as one.
struct VirtualSlab {
  double coverage = 1.0;
  Rgb transmittance{1.0, 1.0, 1.0};  // of what is there, along the normal, interfaces apart
  Rgb f0{0.0, 0.0, 0.0}, f90{1.0, 1.0, 1.0};
  double alpha = 0.0;
  double fuzz = 0.0, fuzz_roughness = 0.5;

  static VirtualSlab of(const SlabValues& slab) {
    const double alpha = lerp(square(slab.roughness), square(slab.second_roughness), slab.second_roughness_weight);
    return {1.0, medium_transmittance(slab), slab.f0, slab.f90, alpha, slab.fuzz_amount, slab.fuzz_roughness};
  }

  /// Share of light along a direction of this cosine that passes, per channel; T^(1/cosine).
  Rgb passes_medium(double cosine) const {
    const double exponent = 1.0 / max(cosine, 1e-4);
    const auto one = [&](double t) { return 1.0 - coverage + coverage * (t > 0.0 ? std::pow(t, exponent) : 0.0); };
    return {one(transmittance.x), one(transmittance.y), one(transmittance.z)};
  }
  /// The same, with what the interface and the fuzz send back.
  Rgb passes(double cosine) const {
    const Rgb specular = LobeAlbedo<double>::of(cosine, alpha).specular(f0, SlabGrazingReflectance::evaluate(f0, f90));
    const double sheen = fuzz * ZeltnerFit::Albedo::evaluate(cosine, fuzz_roughness);
    const Rgb medium = passes_medium(cosine);
    const auto one = [&](double m, double s) {
      return 1.0 - coverage + (m - (1.0 - coverage)) * (1.0 - s) * (1.0 - sheen);
    };
    return {one(medium.x, specular.x), one(medium.y, specular.y), one(medium.z, specular.z)};
  }
};

/// Belcour 2018, An Efficient Rendering of Layered Materials: what adds up is σ = α^1.1/(1 - α^1.1).
inline double lobe_variance(double alpha) {
  const double power = std::pow(min(max(alpha, 0.0), 0.999), 1.1);
  return power / (1.0 - power);
}
inline double alpha_of_variance(double variance) { return std::pow(variance / (1.0 + variance), 1.0 / 1.1); }

/// Index of refraction of a dielectric with this reflectance at normal incidence, and back.
inline double index_of_f0(double f0) {
  const double root = std::sqrt(min(max(f0, 0.0), 0.9999));
  return (1.0 + root) / (1.0 - root);
}
inline double f0_of_index(double index) { return square((index - 1.0) / (index + 1.0)); }

// ---- coverage and transmittance of subtrees ------------------------------------------------------------------------

inline VirtualSlab weighted(VirtualSlab slab, double weight) {
  slab.coverage *= weight;
  return slab;
}

namespace detail {

/// Sums of attributes over what is there, divided by the coverage in the end.
inline VirtualSlab gather(const VirtualSlab& a, double weight_a, const VirtualSlab& b, double weight_b, double coverage,
                          const Rgb& transmittance, const Rgb& f0) {
  const double scale = 1.0 / max(coverage, 1e-9);
  // Colours and roughnesses in the proportion of the light that each sends back.
  const double back_a = weight_a * (mean_channel(a.f0) + 1e-6), back_b = weight_b * (mean_channel(b.f0) + 1e-6);
  const double share = back_b / max(back_a + back_b, 1e-12);
  const double variance = (weight_a * lobe_variance(a.alpha) + weight_b * lobe_variance(b.alpha)) * scale;
  const double fuzz = (weight_a * a.fuzz + weight_b * b.fuzz) * scale;
  const double fuzz_share = weight_b * b.fuzz / max(weight_a * a.fuzz + weight_b * b.fuzz, 1e-12);
  return {.coverage = coverage,
          .transmittance = transmittance * scale,
          .f0 = f0 * scale,
          .f90 = lerp(a.f90, b.f90, share),
          .alpha = alpha_of_variance(variance),
          .fuzz = min(fuzz, 1.0),
          .fuzz_roughness = lerp(a.fuzz_roughness, b.fuzz_roughness, fuzz_share)};
}

}  // namespace detail

inline VirtualSlab mixed(const VirtualSlab& background, const VirtualSlab& foreground, double mix) {
  const double a = (1.0 - mix) * background.coverage, b = mix * foreground.coverage;
  return detail::gather(background, a, foreground, b, a + b,
                        background.transmittance * a + foreground.transmittance * b,
                        background.f0 * a + foreground.f0 * b);
}

inline VirtualSlab layered(const VirtualSlab& top, const VirtualSlab& bottom) {
  const double t = top.coverage, b = bottom.coverage;
  const Rgb transmittance = top.transmittance * (t * (1.0 - b)) + bottom.transmittance * (b * (1.0 - t)) +
                            top.transmittance * bottom.transmittance * (t * b);
  const Rgb f0 = 1.0 - (1.0 - top.f0 * t) * (1.0 - bottom.f0 * b);
  return detail::gather(top, t, bottom, b, t + b * (1.0 - t), transmittance, f0);
}

/// Of the subtree at `index` of a resolved tree.
inline VirtualSlab statistics(const SlabTree& tree, int index) {
  const TreeNode& node = tree.node(index);
  switch (node.kind) {
    case Operator::slab: return VirtualSlab::of(node.slab);
    case Operator::coverage: return weighted(statistics(tree, node.first), node.amount);
    case Operator::horizontal: return mixed(statistics(tree, node.first), statistics(tree, node.second), node.amount);
    default: return layered(statistics(tree, node.first), statistics(tree, node.second));
  }
}

// ---- closures ------------------------------------------------------------------------------------------------------

/// What the renderer evaluates: a slab and what becomes of light on the way to it.
struct Closure {
  SlabValues slab;
  SpecularProfilePointer profile;
  double weight = 1.0;                       // coverage and mixing, of the slab itself
  std::vector<VirtualSlab> above;            // that the view looks through, one for each vertical operator
  VirtualSlab light_above{.coverage = 0.0};  // the same as one, which every light passes
  int leaf = -1;                             // the slab's node
  std::string path, name;

  /// ToViewThroughput (S2).
  Rgb view_throughput(double cosine) const {
    Rgb result{weight, weight, weight};
    for (const VirtualSlab& layer : above) result = result * layer.passes(cosine);
    return result;
  }
  /// BRDF, 1/sr without cosine: 0 unless both directions are above the surface.
  Rgb evaluate(const Direction& wi, const Direction& wo) const {
    if (!(wi.z > 0.0 && wo.z > 0.0)) return {0.0, 0.0, 0.0};
    SlabValues tinted = slab;
    if (profile) tinted.specular_tint = profile->tint(wo.z, wi.z);
    return evaluate_brdf<Slab, double>(tinted, wi, wo) * view_throughput(wo.z) * light_above.passes_medium(wi.z);
  }
};

/// The slab under `above` with the blur of rough interfaces on the way in and out (Belcour 2018, his transmission
/// factors ½|1 - 1/n| and ½|1 - n| at normal incidence; that refraction also widens the lobe n times is not counted).
inline SlabValues with_tracked_roughness(SlabValues slab, const VirtualSlab& above) {
  const double n = index_of_f0(mean_channel(above.f0));
  const double blur = above.coverage *
                      (lobe_variance(0.5 * (n - 1.0) / n * above.alpha) + lobe_variance(0.5 * (n - 1.0) * above.alpha));
  if (blur <= 0.0) return slab;
  const auto blurred = [&](double roughness) {
    return std::sqrt(alpha_of_variance(lobe_variance(square(roughness)) + blur));
  };
  slab.roughness = blurred(slab.roughness);
  slab.second_roughness = blurred(slab.second_roughness);
  return slab;
}

struct WalkOptions {
  bool roughness_tracking = true;
  /// Every combination of partly covering slabs on its own: the many closures that the statistics save. Mixes count as
  /// events too.
  bool exact_statistics = false;
  double smallest_weight = 1e-6;  // closures that weigh less are dropped
};

namespace detail {

inline void collect(const SlabTree& tree, int index, Closure closure, const WalkOptions& options,
                    std::vector<Closure>& closures) {
  if (closure.weight < options.smallest_weight) return;
  const TreeNode& node = tree.node(index);
  switch (node.kind) {
    case Operator::slab: {
      closure.slab = node.slab;
      closure.profile = node.profile;
      closure.leaf = index;
      closure.path = node.path;
      closure.name = node.name;
      for (const VirtualSlab& layer : closure.above) closure.light_above = layered(closure.light_above, layer);
      const Rgb reach = closure.view_throughput(1.0);
      if (largest_channel(reach) < options.smallest_weight) return;
      if (options.roughness_tracking) closure.slab = with_tracked_roughness(closure.slab, closure.light_above);
      closures.push_back(std::move(closure));
      return;
    }
    case Operator::coverage:
      closure.weight *= node.amount;
      return collect(tree, node.first, std::move(closure), options, closures);
    case Operator::horizontal: {
      Closure background = closure;
      background.weight *= 1.0 - node.amount;
      closure.weight *= node.amount;
      collect(tree, node.first, std::move(background), options, closures);
      return collect(tree, node.second, std::move(closure), options, closures);
    }
    default: {
      Closure below = closure;
      below.above.push_back(statistics(tree, node.first));
      collect(tree, node.first, std::move(closure), options, closures);
      return collect(tree, node.second, std::move(below), options, closures);
    }
  }
}

}  // namespace detail

/// One outcome of all coverages and mixes: slabs from the top down.
struct SlabEvent {
  double probability = 1.0;
  std::vector<int> leaves;
};

/// All outcomes at a node of a resolved tree; an opaque slab ends one, what lies below it being out of sight.
inline std::vector<SlabEvent> slab_events(const SlabTree& tree, int index) {
  const TreeNode& node = tree.node(index);
  const auto scaled = [&](int operand, double weight) {
    std::vector<SlabEvent> events = weight > 0.0 ? slab_events(tree, operand) : std::vector<SlabEvent>{};
    for (SlabEvent& event : events) event.probability *= weight;
    return events;
  };
  switch (node.kind) {
    case Operator::slab: return {{1.0, {index}}};
    case Operator::coverage: {
      std::vector<SlabEvent> events = scaled(node.first, node.amount);
      if (node.amount < 1.0) events.push_back({1.0 - node.amount, {}});
      return events;
    }
    case Operator::horizontal: {
      std::vector<SlabEvent> events = scaled(node.first, 1.0 - node.amount);
      for (SlabEvent& event : scaled(node.second, node.amount)) events.push_back(std::move(event));
      return events;
    }
    default: {
      std::vector<SlabEvent> events;
      const std::vector<SlabEvent> below = slab_events(tree, node.second);
      for (const SlabEvent& top : slab_events(tree, node.first)) {
        if (!top.leaves.empty() && is_opaque(tree.node(top.leaves.back()).slab)) {
          events.push_back(top);
          continue;
        }
        for (const SlabEvent& bottom : below) {
          SlabEvent both{top.probability * bottom.probability, top.leaves};
          both.leaves.insert(both.leaves.end(), bottom.leaves.begin(), bottom.leaves.end());
          events.push_back(std::move(both));
        }
      }
      return events;
    }
  }
}

/// Closures of a tree, resolved or not.
inline std::vector<Closure> walk(const SlabTree& given, const WalkOptions& options = {}) {
  const SlabTree tree = resolved(given);
  std::vector<Closure> closures;
  if (!options.exact_statistics) {
    detail::collect(tree, tree.root, {}, options, closures);
    return closures;
  }
  for (const SlabEvent& event : slab_events(tree, tree.root)) {
    VirtualSlab above{.coverage = 0.0};
    std::vector<VirtualSlab> layers;
    for (const int leaf : event.leaves) {
      const TreeNode& node = tree.node(leaf);
      Closure closure{.slab = node.slab,
                      .profile = node.profile,
                      .weight = event.probability,
                      .above = layers,
                      .light_above = above,
                      .leaf = leaf,
                      .path = node.path,
                      .name = node.name};
      if (options.roughness_tracking) closure.slab = with_tracked_roughness(closure.slab, above);
      if (closure.weight * largest_channel(closure.view_throughput(1.0)) >= options.smallest_weight) {
        closures.push_back(std::move(closure));
      }
      layers.push_back(VirtualSlab::of(node.slab));
      above = layered(above, layers.back());
    }
  }
  return closures;
}

inline Rgb evaluate(const std::vector<Closure>& closures, const Direction& wi, const Direction& wo) {
  Rgb sum{0.0, 0.0, 0.0};
  for (const Closure& closure : closures) sum = sum + closure.evaluate(wi, wo);
  return sum;
}

/// What a material seen as a whole lets through: its coverage and transmittance (S2, slide 48).
inline VirtualSlab root_statistics(const SlabTree& given) {
  const SlabTree tree = resolved(given);
  return statistics(tree, tree.root);
}

}  // namespace lobefit
