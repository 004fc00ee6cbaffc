#include "report/tree_figure.h"

#include <fmt/format.h>

#include "models/substrate/walk.h"
#include "reference/srgb.h"
#include "report/figure_layout.h"

namespace lobefit {

using namespace figure_layout;

namespace {

// ---- words ---------------------------------------------------------------------------------------------------------

std::string colour_text(const Rgb& colour) {
  const auto one = [](double value) {
    std::string text = fmt::format("{:.2g}", value);
    return text.starts_with("0.") ? text.substr(1) : text;
  };
  const std::string x = one(colour.x), y = one(colour.y), z = one(colour.z);
  return x == y && y == z ? x : fmt::format("{} {} {}", x, y, z);
}

std::string percent(double share) { return fmt::format("{:.3g} %", 100.0 * share); }

bool is_grey(const Rgb& colour) { return colour.x == colour.y && colour.y == colour.z; }

/// What a slab has beyond its colours.
std::vector<std::string> features(const TreeNode& node) {
  const SlabValues& slab = node.slab;
  std::vector<std::string> list{fmt::format("roughness {:.3g}", slab.roughness)};
  if (slab.anisotropy != 0.0) list.push_back(fmt::format("anisotropy {:.3g}", slab.anisotropy));
  if (slab.second_roughness_weight > 0.0) {
    list.push_back(
        fmt::format("second roughness {:.3g}, {}", slab.second_roughness, percent(slab.second_roughness_weight)));
  }
  if (!is_grey(slab.f90)) list.push_back("F90 " + colour_text(slab.f90));
  if (!is_opaque(slab)) {
    list.push_back(fmt::format("{:.3g} cm thick", slab.thickness));
    if (slab.phase_anisotropy != 0.0) list.push_back(fmt::format("g {:.3g}", slab.phase_anisotropy));
  }
  if (slab.fuzz_amount > 0.0) {
    list.push_back(fmt::format("fuzz roughness {:.3g}, {}", slab.fuzz_roughness, percent(slab.fuzz_amount)));
    list.push_back("fuzz colour " + colour_text(slab.fuzz_color));
  }
  if (largest_channel(slab.emissive) > 0.0) list.push_back("emits " + colour_text(slab.emissive));
  if (slab.glint_density > 0.0) list.push_back(fmt::format("glints {:.3g}/uv²", slab.glint_density));
  if (node.profile) {
    list.push_back(fmt::format("specular profile, {} views x {} lights", node.profile->views, node.profile->lights));
  }
  const int model = choice_number(slab.diffuse_model, static_cast<int>(slab_diffuse_choices.size()));
  if (model != 0) list.emplace_back(slab_diffuse_choices[static_cast<std::size_t>(model)]);
  return list;
}

std::string operator_text(const TreeNode& node) {
  switch (node.kind) {
    case Operator::slab: return node.name.empty() ? "slab" : node.name;
    case Operator::coverage: return "coverage " + percent(node.amount);
    case Operator::select: return fmt::format("select {}, mask {:.3g}", node.amount < 0.5 ? "a" : "b", node.amount);
    case Operator::vertical:
      return node.amount < 0.0 ? std::string("vertical") : fmt::format("vertical, {:.3g} cm", node.amount);
    case Operator::horizontal: return "horizontal, mix " + percent(node.amount);
  }
  return {};
}

std::string statistics_text(const VirtualSlab& slab) {
  return fmt::format("C {:.3g}, T {}", slab.coverage, colour_text(slab.transmittance));
}

// ---- the tree as given, beside the tree as walked
// --------------------------------------------------------------------

struct Trees {
  explicit Trees(const SlabTree& tree) : given(tree), walked(resolved(tree)) {}
  const SlabTree& given;
  SlabTree walked;
};

/// A node of both trees; `walked` is -1 where a selection left it out.
struct NodePair {
  int given, walked;
  std::string role;  // in its operator
};

/// What there is to know of a slab: thickness and opacity are those of the walk.
const TreeNode& node_of(const Trees& trees, const NodePair& pair) {
  const TreeNode& given = trees.given.node(pair.given);
  return given.kind == Operator::slab && pair.walked >= 0 ? trees.walked.node(pair.walked) : given;
}

std::vector<NodePair> operands(const Trees& trees, const NodePair& pair) {
  const TreeNode& node = trees.given.node(pair.given);
  const auto walked = [&](int TreeNode::*operand) {
    return pair.walked < 0 ? -1 : trees.walked.node(pair.walked).*operand;
  };
  switch (node.kind) {
    case Operator::slab: return {};
    case Operator::coverage: return {{node.first, walked(&TreeNode::first), "operand"}};
    case Operator::select:
      // The walk knows the chosen operand alone, in the selection's place.
      return {{node.first, node.amount < 0.5 ? pair.walked : -1, "a"},
              {node.second, node.amount < 0.5 ? -1 : pair.walked, "b"}};
    case Operator::vertical:
      return {{node.first, walked(&TreeNode::first), "top"}, {node.second, walked(&TreeNode::second), "bottom"}};
    case Operator::horizontal:
      return {{node.first, walked(&TreeNode::first), "background " + percent(1.0 - node.amount)},
              {node.second, walked(&TreeNode::second), "foreground " + percent(node.amount)}};
  }
  return {};
}

// ---- text
// ------------------------------------------------------------------------------------------------------------

void append_text(const Trees& trees, const NodePair& pair, const std::string& indent, std::string& text) {
  const TreeNode& node = node_of(trees, pair);
  if (node.kind == Operator::slab) {
    text += fmt::format("{}: diffuse {}, F0 {}, {}", operator_text(node), colour_text(node.slab.diffuse_albedo),
                        colour_text(node.slab.f0), fmt::join(features(node), ", "));
  } else {
    text += operator_text(node);
  }
  text += pair.walked < 0 ? "  [left out]\n"
                          : fmt::format("  [{}]\n", statistics_text(statistics(trees.walked, pair.walked)));
  const std::vector<NodePair> list = operands(trees, pair);
  for (std::size_t i = 0; i < list.size(); ++i) {
    const bool last = i + 1 == list.size();
    text += fmt::format("{}{} {}: ", indent, last ? "└─" : "├─", list[i].role);
    append_text(trees, list[i], indent + (last ? "   " : "│  "), text);
  }
}

// ---- picture, in pixels
// ------------------------------------------------------------------------------------------------

constexpr double margin = 16.0, slab_width = 224.0, gap_across = 18.0, gap_down = 46.0, operator_width = 184.0,
                 operator_height = 42.0, padding = 10.0, line_height = 15.0, small_size = 10.0, swatch_height = 24.0;
/// Of a slab above its list of features.
constexpr double slab_head = 86.0;

/// XML text of at most `room` pixels. What is no text becomes a question mark.
std::string xml(std::string_view text, double size, double room) {
  const auto most = static_cast<std::size_t>(room / (character_width * size));
  const bool too_long = length(std::string(text)) > most;
  std::string result;
  for (std::size_t count = 0; !text.empty() && !(too_long && count + 1 >= most); ++count) {
    const std::size_t bytes = character_bytes(text);
    const char first = text[0];
    if (bytes == 0) {
      result += '?';
    } else if (static_cast<unsigned char>(first) < 0x20) {
      result += ' ';
    } else if (first == '&') {
      result += "&amp;";
    } else if (first == '<') {
      result += "&lt;";
    } else if (first == '>') {
      result += "&gt;";
    } else {
      result += text.substr(0, bytes);
    }
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return too_long ? result + "…" : result;
}

std::string web_colour(const Rgb& colour) {
  const auto code = [](double linear) { return std::lround(255.0 * srgb_encode(saturate(linear))); };
  return fmt::format("#{:02x}{:02x}{:02x}", code(colour.x), code(colour.y), code(colour.z));
}

class TreePicture {
 public:
  TreePicture(const SlabTree& tree, const std::string& title)
      : trees_(tree), title_(title), top_(title.empty() ? margin : margin + 28.0) {
    draw({tree.root, trees_.walked.root, ""}, 0);
  }

  std::string document() const {
    const double height = bottom_ + 26.0 + margin;
    // A tree of one slab still has a footer and a title.
    const double width = std::max({next_left_ - gap_across + margin,
                                   0.68 * title_size * static_cast<double>(length(title_)) + 2.0 * margin,
                                   character_width * small_size * static_cast<double>(length(footer)) + 2.0 * margin});
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} "
        "{1:.0f}\" font-family=\"DejaVu Sans, sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        width, height);
    if (!title_.empty()) svg += text(margin, margin + 12.0, title_, title_size, width, "font-weight=\"bold\"");
    return svg + edges_ + nodes_ + text(margin, height - margin, footer, small_size, width, "fill=\"#555555\"") +
           "</svg>\n";
  }

 private:
  static constexpr const char* footer = "C coverage, T transmittance of what is there, along the normal";

  static std::string text(double x, double y, std::string_view words, double size, double room,
                          std::string_view attributes) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:g}\" {}>{}</text>\n", x, y, size, attributes,
                       xml(words, size, room));
  }

  /// Draws the subtree with its leaves in the next columns; returns the middle of its root. Every node keeps to its
  /// subtree's columns, so nothing overlaps.
  double draw(const NodePair& pair, int depth) {
    const double y = top_ + depth * (operator_height + gap_down);
    const std::vector<NodePair> list = operands(trees_, pair);
    double middle = 0.0;
    if (list.empty()) {
      middle = next_left_ + 0.5 * slab_width;
      next_left_ += slab_width + gap_across;
      draw_slab(pair, middle, y);
    } else {
      std::vector<double> middles;
      for (const NodePair& operand : list) middles.push_back(draw(operand, depth + 1));
      middle = 0.5 * (middles.front() + middles.back());
      for (std::size_t i = 0; i < list.size(); ++i) draw_edge(list[i], middle, y + operator_height, middles[i]);
      draw_operator(pair, middle, y);
    }
    return middle;
  }

  void draw_edge(const NodePair& operand, double from_x, double from_y, double x) {
    const double turn = from_y + 0.4 * gap_down, y = from_y + gap_down;
    edges_ += fmt::format(
        "<path d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}V{:.1f}\" fill=\"none\" stroke=\"#777777\" stroke-width=\"1.5\"{}/>\n",
        from_x, from_y, turn, x, y, operand.walked < 0 ? " stroke-dasharray=\"4 3\"" : "");
    edges_ += text(x + 6.0, y - 6.0, operand.role, small_size, 0.5 * slab_width, "fill=\"#555555\"");
  }

  void draw_operator(const NodePair& pair, double middle, double y) {
    const TreeNode& node = trees_.given.node(pair.given);
    nodes_ += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:g}\" height=\"{:g}\" rx=\"12\" fill=\"#e8eef5\" "
        "stroke=\"#5b7ea3\"/>\n",
        middle - 0.5 * operator_width, y, operator_width, operator_height);
    const double room = operator_width - 2.0 * padding;
    nodes_ +=
        text(middle, y + 17.0, operator_text(node), label_size, room, "text-anchor=\"middle\" font-weight=\"bold\"");
    nodes_ += text(middle, y + 33.0, state(pair), small_size, room, "text-anchor=\"middle\"");
  }

  void draw_slab(const NodePair& pair, double middle, double y) {
    const TreeNode& node = node_of(trees_, pair);
    const std::vector<std::string> list = features(node);
    const double left = middle - 0.5 * slab_width, room = slab_width - 2.0 * padding;
    const double height = slab_head + line_height * static_cast<double>(list.size()) + padding;
    bottom_ = std::max(bottom_, y + height);
    nodes_ += fmt::format(
        "<g{}>\n<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:g}\" height=\"{:.1f}\" fill=\"#fbfbfb\" "
        "stroke=\"#777777\"/>\n",
        pair.walked < 0 ? " opacity=\"0.5\"" : "", left, y, slab_width, height);
    nodes_ += text(left + padding, y + 18.0, operator_text(node), label_size, room, "font-weight=\"bold\"");
    struct Swatch {
      const char* name;
      Rgb colour;
      const char* absent;  // what to say in place of a colour
    };
    const Rgb &f0 = node.slab.f0, &diffuse = node.slab.diffuse_albedo;
    const std::array<Swatch, 3> swatches{
        {{"diffuse", diffuse, nullptr},
         {"F0", f0, largest_channel(f0) > 0.0 ? nullptr : "no interface"},
         {"T", medium_transmittance(node.slab), is_opaque(node.slab) ? "opaque" : nullptr}}};
    const double step = room / static_cast<double>(swatches.size()), width = step - 6.0;
    for (std::size_t i = 0; i < swatches.size(); ++i) {
      const auto& [name, colour, absent] = swatches[i];
      const double x = left + padding + step * static_cast<double>(i);
      nodes_ += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:g}\" fill=\"{}\" stroke=\"#777777\" "
          "stroke-width=\"0.7\"/>\n",
          x, y + 27.0, width, swatch_height, absent ? "none" : web_colour(colour));
      if (absent) {
        nodes_ += fmt::format("<path d=\"M{:.1f} {:.1f}l{:.1f} {:g}\" stroke=\"#777777\" stroke-width=\"0.7\"/>\n", x,
                              y + 27.0, width, swatch_height);
      }
      nodes_ += text(x, y + 63.0, name, small_size, width, "fill=\"#555555\"");
      nodes_ += text(x, y + 76.0, absent ? absent : colour_text(colour), small_size - 1.0, step, "");
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
      nodes_ += text(left + padding, y + slab_head + line_height * static_cast<double>(i) + 8.0, list[i], tick_size,
                     room, "");
    }
    nodes_ += "</g>\n";
  }

  std::string state(const NodePair& pair) const {
    return pair.walked < 0 ? "left out" : statistics_text(statistics(trees_.walked, pair.walked));
  }

  Trees trees_;
  std::string title_;
  double top_, next_left_ = margin, bottom_ = 0.0;
  std::string edges_, nodes_;
};

}  // namespace

std::string tree_text(const SlabTree& tree) {
  const Trees trees(tree);
  std::string text;
  append_text(trees, {tree.root, trees.walked.root, ""}, "", text);
  return text;
}

std::string tree_svg(const SlabTree& tree, const std::string& title) { return TreePicture(tree, title).document(); }

}  // namespace lobefit
