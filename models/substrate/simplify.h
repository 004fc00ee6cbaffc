// Collapsing a tree, operator by operator, until it fits (S2, slides 57-62).
#pragma once

#include <functional>

#include "models/substrate/blend.h"
#include "models/substrate/storage.h"
#include "models/substrate/walk.h"

namespace lobefit {

/// How two slabs become one. Of the fitted rules, fitted_haze keeps two lobes where they differ, for 4 bytes;
/// fitted_first and fitted_second keep the lobe of the top or background, or of the other, with all the light.
enum class BlendRule { baseline, fitted, fitted_haze, fitted_first, fitted_second };
inline constexpr std::array<std::string_view, 5> blend_rule_names{"baseline", "fitted", "fitted_haze", "fitted_first",
                                                                  "fitted_second"};

/// What the fitted rules need: their constants, and the cosine of the view that the material is stored for.
struct BlendSetting {
  FittedBlend::Constants<double> constants = FittedBlend::initial();
  double cos_theta_o = FittedBlend::mean_view;
};

inline SlabValues blend_horizontal(const SlabValues& background, const SlabValues& foreground, double mix,
                                   BlendRule rule, const BlendSetting& at) {
  switch (rule) {
    case BlendRule::baseline: return BaselineBlend::horizontal(background, foreground, mix);
    case BlendRule::fitted: return FittedBlend::horizontal(background, foreground, mix, at.cos_theta_o, at.constants);
    case BlendRule::fitted_haze:
      return FittedBlend::horizontal<LobeMerge::both>(background, foreground, mix, at.cos_theta_o, at.constants);
    case BlendRule::fitted_first:
      return FittedBlend::horizontal<LobeMerge::first>(background, foreground, mix, at.cos_theta_o, at.constants);
    default:
      return FittedBlend::horizontal<LobeMerge::second>(background, foreground, mix, at.cos_theta_o, at.constants);
  }
}
inline SlabValues blend_vertical(const SlabValues& top, const SlabValues& bottom, BlendRule rule,
                                 const BlendSetting& at) {
  switch (rule) {
    case BlendRule::baseline: return BaselineBlend::vertical(top, bottom);
    case BlendRule::fitted: return FittedBlend::vertical(top, bottom, at.cos_theta_o, at.constants);
    case BlendRule::fitted_haze:
      return FittedBlend::vertical<LobeMerge::both>(top, bottom, at.cos_theta_o, at.constants);
    case BlendRule::fitted_first:
      return FittedBlend::vertical<LobeMerge::first>(top, bottom, at.cos_theta_o, at.constants);
    default: return FittedBlend::vertical<LobeMerge::second>(top, bottom, at.cos_theta_o, at.constants);
  }
}

/// A slab that covers a share of the surface.
struct PartialSlab {
  SlabValues slab{};
  double coverage = 1.0;
};

/// Of the specular light that two operands send back at normal incidence, the share of the second.
inline double specular_share(Operator kind, const PartialSlab& first, const PartialSlab& second, double mix) {
  double a = first.coverage, b = second.coverage;
  if (kind == Operator::horizontal) {
    a *= 1.0 - mix;
    b *= mix;
  } else {
    const double passed = 1.0 - mean_channel(first.slab.f0), through = mean_channel(medium_transmittance(first.slab));
    b *= 1.0 - first.coverage + first.coverage * square(passed * through);
  }
  a *= mean_channel(first.slab.f0);
  b *= mean_channel(second.slab.f0);
  return a + b > 0.0 ? b / (a + b) : 0.0;
}

/// A mix in the proportion of what is there.
inline PartialSlab blend_horizontal(const PartialSlab& background, const PartialSlab& foreground, double mix,
                                    BlendRule rule, const BlendSetting& at) {
  const double a = (1.0 - mix) * background.coverage, b = mix * foreground.coverage;
  if (b <= 0.0) return {background.slab, a};
  if (a <= 0.0) return {foreground.slab, b};
  return {blend_horizontal(background.slab, foreground.slab, b / (a + b), rule, at), a + b};
}
/// Layers by the three outcomes that show anything, mixed in proportion: both, the top alone, the bottom alone.
inline PartialSlab blend_vertical(const PartialSlab& top, const PartialSlab& bottom, BlendRule rule,
                                  const BlendSetting& at) {
  const double t = top.coverage, b = bottom.coverage;
  PartialSlab result{bottom.slab, (1.0 - t) * b};
  const auto add = [&](const SlabValues& slab, double weight) {
    if (weight <= 0.0) return;
    const double sum = result.coverage + weight;
    result = {result.coverage > 0.0 ? blend_horizontal(result.slab, slab, weight / sum, rule, at) : slab, sum};
  };
  add(blend_vertical(top.slab, bottom.slab, rule, at), t * b);
  add(top.slab, t * (1.0 - b));
  return result;
}

// ---- collapsing one operator ---------------------------------------------------------------------------------------

/// A resolved tree whose slabs keep their thicknesses, whatever is collapsed above them.
inline SlabTree collapsible(const SlabTree& given) {
  SlabTree tree = resolved(given);
  for (TreeNode& node : tree.nodes) {
    if (node.kind == Operator::vertical) node.amount = -1.0;
  }
  return tree;
}

/// The slab at a node, through coverages; null slab (index -1) where there are operators below.
struct SlabUnderCoverage {
  int slab = -1;
  double coverage = 1.0;

  static SlabUnderCoverage of(const SlabTree& tree, int index) {
    SlabUnderCoverage result;
    for (int i = index;;) {
      const TreeNode& node = tree.node(i);
      if (node.kind == Operator::slab) {
        result.slab = i;
        return result;
      }
      if (node.kind != Operator::coverage) return result;
      result.coverage *= node.amount;
      i = node.first;
    }
  }
};

/// Mixes and layers whose operands are slabs, in the order of the nodes: what can be collapsed next.
inline std::vector<int> collapsible_operators(const SlabTree& tree) {
  std::vector<int> result;
  const std::function<void(int)> visit = [&](int index) {
    const TreeNode& node = tree.node(index);
    if (node.kind == Operator::slab) return;
    if (node.kind == Operator::coverage) return visit(node.first);
    if (SlabUnderCoverage::of(tree, node.first).slab >= 0 && SlabUnderCoverage::of(tree, node.second).slab >= 0) {
      result.push_back(index);
      return;
    }
    visit(node.first);
    visit(node.second);
  };
  visit(tree.root);
  return result;
}

/// Operators from the root down to a node.
inline int depth_of(const SlabTree& tree, int target) {
  const std::function<int(int, int)> find = [&](int index, int depth) {
    if (index == target) return depth;
    const TreeNode& node = tree.node(index);
    if (node.kind == Operator::slab) return -1;
    const int first = find(node.first, depth + 1);
    return first >= 0 || node.second < 0 ? first : find(node.second, depth + 1);
  };
  return find(tree.root, 0);
}

/// The tree with one operator of collapsible_operators() made a slab, in a coverage where it is not whole.
inline SlabTree collapsed(SlabTree tree, int index, BlendRule rule, const BlendSetting& at) {
  const TreeNode node = tree.node(index);
  const auto operand = [&](int number) {
    const SlabUnderCoverage found = SlabUnderCoverage::of(tree, number);
    return PartialSlab{tree.node(found.slab).slab, found.coverage};
  };
  const auto profile = [&](int number) { return tree.node(SlabUnderCoverage::of(tree, number).slab).profile; };
  const PartialSlab merged = node.kind == Operator::horizontal
                                 ? blend_horizontal(operand(node.first), operand(node.second), node.amount, rule, at)
                                 : blend_vertical(operand(node.first), operand(node.second), rule, at);
  const auto name = [&](int number) {
    const TreeNode& slab = tree.node(SlabUnderCoverage::of(tree, number).slab);
    return slab.name.empty() ? slab.path : slab.name;
  };
  TreeNode slab{.kind = Operator::slab,
                .slab = merged.slab,
                .profile = mixed(profile(node.first), profile(node.second),
                                 specular_share(node.kind, operand(node.first), operand(node.second), node.amount)),
                .name = name(node.first) + (node.kind == Operator::horizontal ? "|" : "/") + name(node.second),
                .path = node.path};
  if (merged.coverage >= 1.0 - 1e-12) {
    tree.node(index) = std::move(slab);
  } else {
    const int added = tree.add(std::move(slab));
    tree.node(index) = {.kind = Operator::coverage, .first = added, .amount = merged.coverage, .path = node.path};
  }
  return tree;
}

// ---- features ------------------------------------------------------------------------------------------------------

/// What collapsing gives up last, in this order: by bytes saved, and by how little most materials show it.
enum class SlabFeature { glints, specular_profile, f90, anisotropy, second_lobe, fuzz };
inline constexpr std::array<std::string_view, 6> slab_feature_names{"glints",     "specular_profile", "f90",
                                                                    "anisotropy", "second_lobe",      "fuzz"};

/// What a slab's node makes use of.
inline ClosureFeatures features_of(const SlabValues& slab, const SpecularProfilePointer& profile) {
  ClosureFeatures features = features_of(slab);
  features.specular_profile = profile != nullptr;
  return features;
}

inline bool has_feature(const TreeNode& node, SlabFeature feature) {
  const ClosureFeatures features = features_of(node.slab, node.profile);
  switch (feature) {
    case SlabFeature::glints: return features.glints;
    case SlabFeature::specular_profile: return features.specular_profile;
    case SlabFeature::f90: return features.f90;
    case SlabFeature::anisotropy: return features.anisotropy;
    case SlabFeature::second_lobe: return features.second_lobe;
    default: return features.fuzz;
  }
}

/// Turns a slab's feature off: glints become their far field, the lobe; a profile the tints of its diagonal's ends, in
/// f0 and f90; two lobes one of their mean variance; fibres what they send back on the average, as diffuse albedo.
inline void remove_feature(TreeNode& node, SlabFeature feature) {
  SlabValues& slab = node.slab;
  switch (feature) {
    case SlabFeature::glints: slab.glint_density = 0.0; break;
    case SlabFeature::specular_profile:
      slab.f0 = slab.f0 * node.profile->tint(1.0, 1.0);
      slab.f90 = slab.f90 * node.profile->tint(0.0, 0.0);
      node.profile = nullptr;
      break;
    case SlabFeature::f90: slab.f90 = {1.0, 1.0, 1.0}; break;
    case SlabFeature::anisotropy: slab.anisotropy = 0.0; break;
    case SlabFeature::second_lobe:
      slab.roughness = std::sqrt(
          alpha_of_variance(lerp(lobe_variance(square(slab.roughness)), lobe_variance(square(slab.second_roughness)),
                                 slab.second_roughness_weight)));
      slab.second_roughness_weight = 0.0;
      break;
    case SlabFeature::fuzz: {
      // 2 ∫ R μ dμ by four midpoints: R is smooth.
      double albedo = 0.0;
      for (const double mu2 : {0.125, 0.375, 0.625, 0.875}) {
        albedo += 0.25 * ZeltnerFit::Albedo::evaluate(std::sqrt(mu2), slab.fuzz_roughness);
      }
      const double share = slab.fuzz_amount * albedo;
      slab.diffuse_albedo = at_most(slab.diffuse_albedo * (1.0 - share) + slab.fuzz_color * share, 1.0);
      slab.fuzz_amount = 0.0;
    }
  }
}

/// Turns a feature off in every slab that is reached; false where none had it.
inline bool drop_feature(SlabTree& tree, SlabFeature feature) {
  bool any = false;
  const std::function<void(int)> visit = [&](int index) {
    TreeNode& node = tree.node(index);
    if (node.kind != Operator::slab) {
      visit(node.first);
      if (node.second >= 0) visit(node.second);
    } else if (has_feature(node, feature)) {
      remove_feature(node, feature);
      any = true;
    }
  };
  visit(tree.root);
  return any;
}

// ---- bytes ---------------------------------------------------------------------------------------------------------

/// What a pixel has to store of a walk's closures. A layer that doesn't scatter needs no medium of its own: what it
/// takes from light is stored with those below it.
inline std::vector<ClosureFeatures> stored_features(const std::vector<Closure>& closures) {
  std::vector<ClosureFeatures> result;
  for (const Closure& closure : closures) {
    ClosureFeatures features = features_of(closure.slab, closure.profile);
    features.medium = features.medium && features.diffuse;
    features.below = !closure.above.empty();
    features.throughput = features.below || closure.weight < 1.0;
    result.push_back(features);
  }
  return result;
}

inline int tree_bytes(const std::vector<Closure>& closures) {
  // An empty pixel has a header all the same.
  return closures.empty() ? 4 : material_bytes(stored_features(closures));
}

// ---- strategies ----------------------------------------------------------------------------------------------------

/// One step of simplifying: an operator collapsed by a rule, or a feature off.
struct SimplifyStep {
  int index = -1;  // of the operator in collapsible(tree); -1: a feature
  BlendRule rule = BlendRule::baseline;
  SlabFeature feature = SlabFeature::glints;
};

/// The tree after some steps, stored for a view.
inline SlabTree simplified(const SlabTree& given, std::span<const SimplifyStep> steps, const BlendSetting& at) {
  SlabTree tree = collapsible(given);
  for (const SimplifyStep& step : steps) {
    if (step.index >= 0) {
      tree = collapsed(std::move(tree), step.index, step.rule, at);
    } else {
      drop_feature(tree, step.feature);
    }
  }
  return tree;
}

/// "collapse $.vertical (fitted)", "drop fuzz".
inline std::string step_text(const SlabTree& given, const SimplifyStep& step) {
  if (step.index < 0) return "drop " + std::string(slab_feature_names[static_cast<std::size_t>(step.feature)]);
  const SlabTree tree = collapsible(given);
  const TreeNode& node = tree.node(step.index);
  return "collapse " +
         (node.path.empty() ? std::string(operator_names[static_cast<std::size_t>(node.kind)]) : node.path) + " (" +
         std::string(blend_rule_names[static_cast<std::size_t>(step.rule)]) + ")";
}

/// A stage on the way from the full tree to a single plain slab.
struct SimplifiedTree {
  std::vector<SimplifyStep> steps;
  int bytes = 0;
  std::size_t closures = 0;
  double error = 0.0;  // by whoever asked
};

namespace detail {

inline SimplifiedTree stage(const SlabTree& given, std::vector<SimplifyStep> steps,
                            const FittedBlend::Constants<double>& constants) {
  const std::vector<Closure> closures = walk(simplified(given, steps, {constants}));
  return {std::move(steps), tree_bytes(closures), closures.size()};
}

inline std::vector<SimplifyStep> with_step(std::vector<SimplifyStep> steps, const SimplifyStep& step) {
  steps.push_back(step);
  return steps;
}

}  // namespace detail

/// Substrate's order: the deepest operator first, then features off. The full tree first, the plainest last.
inline std::vector<SimplifiedTree> simplify_deepest_first(const SlabTree& given, BlendRule rule,
                                                          const FittedBlend::Constants<double>& constants) {
  std::vector<SimplifiedTree> stages{detail::stage(given, {}, constants)};
  for (;;) {
    const SlabTree tree = simplified(given, stages.back().steps, {constants});
    const std::vector<int> candidates = collapsible_operators(tree);
    if (candidates.empty()) break;
    const int deepest = *std::max_element(candidates.begin(), candidates.end(),
                                          [&](int a, int b) { return depth_of(tree, a) < depth_of(tree, b); });
    stages.push_back(
        detail::stage(given, detail::with_step(stages.back().steps, {.index = deepest, .rule = rule}), constants));
  }
  for (std::size_t feature = 0; feature < slab_feature_names.size(); ++feature) {
    const SimplifyStep step{.feature = static_cast<SlabFeature>(feature)};
    SlabTree tree = simplified(given, stages.back().steps, {constants});
    if (!drop_feature(tree, step.feature)) continue;
    stages.push_back(detail::stage(given, detail::with_step(stages.back().steps, step), constants));
  }
  return stages;
}

/// The least error for every number of bytes: orders of collapsing, rules at every operator and features off are
/// searched together, keeping the `beam` best trees of each number of steps. What Substrate's order gives, with any one
/// rule, is among the candidates. From most bytes to fewest, errors rising.
inline std::vector<SimplifiedTree> simplify_by_error(const SlabTree& given,
                                                     const FittedBlend::Constants<double>& constants,
                                                     const std::function<double(std::span<const SimplifyStep>)>& error,
                                                     std::size_t beam = 8) {
  constexpr std::array rules{BlendRule::baseline, BlendRule::fitted, BlendRule::fitted_haze, BlendRule::fitted_first,
                             BlendRule::fitted_second};
  std::vector<SimplifiedTree> all;
  const auto judge = [&](SimplifiedTree stage) {
    stage.error = error(stage.steps);
    all.push_back(stage);
    return stage;
  };
  for (const BlendRule rule : rules) {
    for (SimplifiedTree& stage : simplify_deepest_first(given, rule, constants)) judge(std::move(stage));
  }
  std::vector<SimplifiedTree> front{detail::stage(given, {}, constants)};
  while (!front.empty()) {
    std::vector<SimplifiedTree> next;
    for (const SimplifiedTree& from : front) {
      const SlabTree tree = simplified(given, from.steps, {constants});
      const auto take = [&](const SimplifyStep& step) {
        next.push_back(judge(detail::stage(given, detail::with_step(from.steps, step), constants)));
      };
      for (const int index : collapsible_operators(tree)) {
        for (const BlendRule rule : rules) take({.index = index, .rule = rule});
      }
      for (std::size_t feature = 0; feature < slab_feature_names.size(); ++feature) {
        const SimplifyStep step{.feature = static_cast<SlabFeature>(feature)};
        SlabTree without = tree;
        if (drop_feature(without, step.feature)) take(step);
      }
    }
    std::stable_sort(next.begin(), next.end(),
                     [](const SimplifiedTree& a, const SimplifiedTree& b) { return a.error < b.error; });
    front.clear();
    for (SimplifiedTree& candidate : next) {
      if (front.size() >= beam) break;
      const bool known = std::any_of(front.begin(), front.end(), [&](const SimplifiedTree& kept) {
        return kept.bytes == candidate.bytes && kept.error == candidate.error;
      });
      if (!known) front.push_back(std::move(candidate));
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const SimplifiedTree& a, const SimplifiedTree& b) {
    return a.bytes != b.bytes ? a.bytes < b.bytes : a.error < b.error;
  });
  std::vector<SimplifiedTree> best;
  for (SimplifiedTree& candidate : all) {
    if (best.empty() || candidate.error < best.back().error) best.push_back(std::move(candidate));
  }
  std::reverse(best.begin(), best.end());
  return best;
}

}  // namespace lobefit
