// Substrate's trees: slabs joined by operators (S2, slides 33-52).
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "models/substrate/specular_profile.h"
#include "models/substrate/storage.h"

namespace lobefit {

using SlabValues = Slab::Parameters<double>;

enum class Operator { slab, vertical, horizontal, coverage, select };
inline constexpr std::array<std::string_view, 5> operator_names{"slab", "vertical", "horizontal", "coverage", "select"};

/// A node and, by index, its operands. An operand may serve several nodes.
struct TreeNode {
  Operator kind = Operator::slab;
  SlabValues slab{};               // of a slab
  SpecularProfilePointer profile;  // of a slab
  /// Top and bottom; background and foreground; operand alone; a and b.
  int first = -1, second = -1;
  /// Thickness of the top, cm (negative: the slab's own); mix, the share of the foreground; weight; mask: b from ½ on.
  double amount = 0.0;
  std::string name;  // of a slab, for people
  std::string path;  // where it came from, as errors and reports name it
};

/// A material: nodes in any order.
struct SlabTree {
  std::vector<TreeNode> nodes;
  int root = 0;
  /// A flat sheet (foliage, cloth): the lowest slab's medium is as thick as it says, and light passes. Else the
  /// geometry behind the surface makes it opaque (S2, slide 31).
  bool thin = false;
  std::string title;  // for people

  const TreeNode& node(int index) const { return nodes[static_cast<std::size_t>(index)]; }
  TreeNode& node(int index) { return nodes[static_cast<std::size_t>(index)]; }
  int add(TreeNode node) {
    nodes.push_back(std::move(node));
    return static_cast<int>(nodes.size()) - 1;
  }

  int add_slab(const SlabValues& slab, std::string name = "") {
    return add({.kind = Operator::slab, .slab = slab, .name = std::move(name)});
  }
  int add_vertical(int top, int bottom, double thickness) {
    return add({.kind = Operator::vertical, .first = top, .second = bottom, .amount = thickness});
  }
  int add_horizontal(int background, int foreground, double mix) {
    return add({.kind = Operator::horizontal, .first = background, .second = foreground, .amount = mix});
  }
  int add_coverage(int operand, double weight) {
    return add({.kind = Operator::coverage, .first = operand, .amount = weight});
  }
};

/// The neutral parameters of M::describe().
template <class M>
typename M::template Parameters<double> default_parameters() {
  typename M::template Parameters<double> values{};
  M::describe(values, [](auto& member, const ParameterInfo& info) {
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      member = {info.initial, info.initial, info.initial};
    } else {
      member = info.initial;
    }
  });
  return values;
}
inline SlabValues default_slab() { return default_parameters<Slab>(); }

inline double largest_channel(const Rgb& c) { return max(max(c.x, c.y), c.z); }
inline double mean_channel(const Rgb& c) { return (c.x + c.y + c.z) / 3.0; }

/// Whether nothing passes a slab's medium.
inline bool is_opaque(const SlabValues& slab) {
  return min(min(slab.mean_free_path.x, slab.mean_free_path.y), slab.mean_free_path.z) <= 0.0;
}

/// Transmittance of a slab's medium along the normal: exp(-thickness/mean free path), 0 where it is opaque.
inline Rgb medium_transmittance(const SlabValues& slab) {
  const auto one = [&](double mean_free_path) {
    return mean_free_path > 0.0 ? std::exp(-slab.thickness / mean_free_path) : 0.0;
  };
  return {one(slab.mean_free_path.x), one(slab.mean_free_path.y), one(slab.mean_free_path.z)};
}

namespace detail {

/// Gives the medium directly above a vertical operator's bottom its thickness.
inline void set_thickness(SlabTree& tree, int index, double thickness) {
  TreeNode& node = tree.node(index);
  switch (node.kind) {
    case Operator::slab: node.slab.thickness = thickness; return;
    case Operator::vertical: set_thickness(tree, node.second, thickness); return;
    case Operator::coverage: set_thickness(tree, node.first, thickness); return;
    default: set_thickness(tree, node.first, thickness); set_thickness(tree, node.second, thickness);
  }
}

inline int copy_resolved(const SlabTree& from, int index, bool lowest, SlabTree& to, std::size_t depth) {
  // Readers refuse cycles by name; this is for trees made in code.
  if (depth > from.nodes.size()) throw std::invalid_argument("a node of the Substrate tree contains itself");
  TreeNode node = from.node(index);
  const auto copy = [&](int operand, bool operand_lowest) {
    return copy_resolved(from, operand, operand_lowest, to, depth + 1);
  };
  switch (node.kind) {
    case Operator::slab:
      if (lowest) node.slab.mean_free_path = {0.0, 0.0, 0.0};
      break;
    case Operator::select: return copy(node.amount < 0.5 ? node.first : node.second, lowest);
    case Operator::vertical:
      node.first = copy(node.first, false);
      node.second = copy(node.second, lowest);
      if (node.amount >= 0.0) set_thickness(to, node.first, node.amount);
      break;
    case Operator::horizontal:
      node.first = copy(node.first, lowest);
      node.second = copy(node.second, lowest);
      break;
    case Operator::coverage: node.first = copy(node.first, lowest); break;
  }
  return to.add(std::move(node));
}

}  // namespace detail

/// The tree as it is walked: selections made, shared operands copied, thicknesses handed to the slabs, and the lowest
/// slabs opaque unless the tree is thin. Operands come before their operators, the root last.
inline SlabTree resolved(const SlabTree& tree) {
  SlabTree result{.thin = tree.thin};
  result.root = detail::copy_resolved(tree, tree.root, !tree.thin, result, 0);
  return result;
}

}  // namespace lobefit
