#include "reference/substrate/tree_json.h"

#include <fmt/format.h>

#include <map>

#include "models/substrate/conversions.h"
#include "reference/output_file.h"
#include "reference/substrate/unreal_slabs.h"

namespace lobefit {

namespace {

double number_between(const JsonReader& reader, double lower, double upper) {
  const double value = reader.number();
  if (!(value >= lower && value <= upper)) {
    throw reader.error(fmt::format("{} is out of range", value),
                       fmt::format("choose a number from {} to {}", lower, upper));
  }
  return value;
}

Rgb rgb_between(const JsonReader& reader, double lower, double upper) {
  if (!reader.value().is_array()) {
    const double value = number_between(reader, lower, upper);
    return {value, value, value};
  }
  const std::vector<JsonReader> elements = reader.elements();
  if (elements.size() != 3) throw reader.error("expected one number or three", "write a number or [r, g, b]");
  return {number_between(elements[0], lower, upper), number_between(elements[1], lower, upper),
          number_between(elements[2], lower, upper)};
}

/// A slab's names: its parameters, and those of the helper nodes.
std::vector<std::string> slab_keys() {
  std::vector<std::string> keys{"name",          "ior",      "base_color",  "metallic",        "specular",
                                "transmittance", "haziness", "haze_extent", "specular_profile"};
  for (const ParameterInfo& info : describe_parameters<Slab>()) {
    // A profile's value for one pair of directions.
    if (info.name != "specular_tint") keys.emplace_back(info.name);
  }
  return keys;
}

void allow_keys(const JsonReader& reader, const std::vector<std::string>& keys) {
  for (const auto& [key, member] : reader.members()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      throw reader.error("unknown key '" + key + "'", "did you mean '" + nearest_name(key, keys) + "'?");
    }
  }
}

void refuse_together(const JsonReader& reader, const char* helper, std::initializer_list<const char*> others) {
  if (!reader.has(helper)) return;
  for (const char* other : others) {
    if (reader.has(other)) {
      throw reader.error(fmt::format("'{}' and '{}' together", helper, other), "keep one: both set the same thing");
    }
  }
}

/// Sets what is given of a model's parameters.
template <class M>
void read_values(const JsonReader& reader, typename M::template Parameters<double>& values) {
  M::describe(values, [&](auto& member, const ParameterInfo& info) {
    if (!reader.has(info.name)) return;
    const JsonReader value = reader.at(info.name);
    const double upper = info.name == "mean_free_path" ? longest_mean_free_path : info.upper;
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      member = rgb_between(value, info.lower, upper);
    } else if (!info.choices.empty()) {
      const std::string name = value.text();
      const auto found = std::find(info.choices.begin(), info.choices.end(), name);
      if (found == info.choices.end()) {
        throw value.error("unknown choice '" + name + "'", fmt::format("write {}", fmt::join(info.choices, ", ")));
      }
      member = static_cast<double>(found - info.choices.begin());
    } else {
      member = number_between(value, info.lower, upper);
    }
  });
}

/// Colours from grazing to normal.
std::vector<Rgb> read_ramp(const JsonReader& reader) {
  std::vector<Rgb> ramp;
  for (const JsonReader& element : reader.elements()) ramp.push_back(rgb_between(element, 0.0, 1.0));
  if (ramp.empty()) throw reader.error("an empty ramp", "write colours from grazing to normal");
  return ramp;
}

SpecularProfilePointer read_profile(const JsonReader& reader) {
  reader.allow({"table", "view_ramp", "light_ramp"});
  if (!reader.has("table")) {
    if (!reader.has("view_ramp") && !reader.has("light_ramp")) {
      throw reader.error("an empty profile", "write a table, or a view_ramp, a light_ramp or both");
    }
    const auto ramp = [&](const char* key) {
      return reader.has(key) ? read_ramp(reader.at(key)) : std::vector<Rgb>{{1.0, 1.0, 1.0}};
    };
    return std::make_shared<const SpecularProfile>(SpecularProfile::of_ramps(ramp("view_ramp"), ramp("light_ramp")));
  }
  refuse_together(reader, "table", {"view_ramp", "light_ramp"});
  SpecularProfile profile{0, 0, {}};
  for (const JsonReader& row : reader.at("table").elements()) {
    const std::vector<Rgb> tints = read_ramp(row);
    if (profile.views++ > 0 && tints.size() != profile.lights) {
      throw row.error(fmt::format("{} entries where the rows above have {}", tints.size(), profile.lights),
                      "give every view as many lights");
    }
    profile.lights = tints.size();
    profile.tints.insert(profile.tints.end(), tints.begin(), tints.end());
  }
  if (profile.views == 0) throw reader.at("table").error("an empty table", "write a row of colours for each view");
  return std::make_shared<const SpecularProfile>(std::move(profile));
}

TreeNode read_slab(const JsonReader& reader) {
  static const std::vector<std::string> keys = slab_keys();
  allow_keys(reader, keys);
  refuse_together(reader, "ior", {"f0", "base_color"});
  refuse_together(reader, "base_color", {"f0", "diffuse_albedo"});
  refuse_together(reader, "transmittance", {"mean_free_path"});
  refuse_together(reader, "haziness", {"second_roughness", "second_roughness_weight"});

  TreeNode node{.slab = default_slab(), .path = reader.path()};
  SlabValues& slab = node.slab;
  read_values<Slab>(reader, slab);
  if (reader.has("specular_profile")) node.profile = read_profile(reader.at("specular_profile"));
  if (reader.has("name")) node.name = reader.at("name").text();
  if (reader.has("ior")) {
    const double f0 = f0_of_index(number_between(reader.at("ior"), 1.0, 100.0));
    slab.f0 = {f0, f0, f0};
  }
  if (reader.has("base_color")) {
    const double metallic = reader.has("metallic") ? number_between(reader.at("metallic"), 0.0, 1.0) : 0.0;
    const double specular = reader.has("specular") ? number_between(reader.at("specular"), 0.0, 1.0) : 0.5;
    set_metalness(slab, rgb_between(reader.at("base_color"), 0.0, 1.0), metallic, specular);
  } else if (reader.has("metallic") || reader.has("specular")) {
    throw reader.error("metallic and specular without base_color", "add base_color, or write diffuse_albedo and f0");
  }
  if (reader.has("transmittance")) {
    slab.mean_free_path = mean_free_path_of(rgb_between(reader.at("transmittance"), 0.0, 1.0), slab.thickness);
  }
  if (reader.has("haziness")) {
    const double extent = reader.has("haze_extent") ? number_between(reader.at("haze_extent"), 0.0, 20.0) : 3.0;
    set_haziness(slab, number_between(reader.at("haziness"), 0.0, 1.0), extent);
  } else if (reader.has("haze_extent")) {
    throw reader.error("haze_extent without haziness", "add haziness");
  }
  return node;
}

/// Reads nodes, those of "nodes" once each.
class TreeReader {
 public:
  SlabTree tree;

  explicit TreeReader(const JsonReader& document) {
    if (document.has("nodes")) {
      for (const auto& [name, member] : document.at("nodes").members()) named_.emplace(name, member);
    }
  }

  int read(const JsonReader& reader) {
    // Trees are walked by recursion.
    if (depth_ == most_depth) {
      throw reader.error(fmt::format("more than {} nodes inside each other", most_depth), "leave out some operators");
    }
    ++depth_;
    const int index = reader.value().is_string() ? read_name(reader) : read_node(reader);
    --depth_;
    return index;
  }

  /// Nodes that nothing uses have their mistakes told too.
  void read_unused() {
    const std::size_t used = tree.nodes.size();
    for (const auto& [name, reader] : named_) read_named(name, reader, reader);
    tree.nodes.resize(used);
  }

 private:
  static constexpr int most_depth = 100;

  int read_node(const JsonReader& reader) {
    static const std::vector<std::string> known{"slab", "vertical", "horizontal", "coverage", "select", "unreal"};
    // The document itself carries more than its node.
    static const std::vector<std::string> of_document{"$schema", "title", "description", "thin", "nodes", "root"};
    const bool document = reader.path() == "$";
    std::vector<std::pair<std::string, JsonReader>> kinds;
    for (const auto& [key, member] : reader.members()) {
      if (document && std::find(of_document.begin(), of_document.end(), key) != of_document.end()) continue;
      if (std::find(known.begin(), known.end(), key) == known.end()) {
        std::vector<std::string> names = known;
        if (document) names.insert(names.end(), of_document.begin(), of_document.end());
        throw reader.error("unknown key '" + key + "'", "did you mean '" + nearest_name(key, names) + "'?");
      }
      kinds.emplace_back(key, member);
    }
    if (document && reader.has("root")) {
      if (!kinds.empty()) throw reader.error("'root' beside a node", "move the node into root, or into nodes");
      return read(reader.at("root"));
    }
    if (kinds.size() != 1) {
      throw reader.error(fmt::format("expected one of {}, got {} of them", fmt::join(known, ", "), kinds.size()),
                         "write {\"slab\": { … }} or an operator");
    }
    const auto& [kind, member] = kinds.front();
    if (kind == "slab") return add(read_slab(member), member);
    if (kind == "vertical") return read_vertical(member);
    if (kind == "horizontal") return read_pair(member, Operator::horizontal, "background", "foreground", "mix");
    if (kind == "select") return read_pair(member, Operator::select, "a", "b", "mask");
    if (kind == "coverage") {
      member.allow({"operand", "weight"});
      const int operand = read_operand(member, "operand");
      return add(
          {.kind = Operator::coverage, .first = operand, .amount = number_between(member.at("weight"), 0.0, 1.0)},
          member);
    }
    return read_unreal(member);
  }

  int add(TreeNode node, const JsonReader& reader) {
    node.path = reader.path();
    return tree.add(std::move(node));
  }

  int read_operand(const JsonReader& reader, const char* key) {
    if (!reader.has(key) || reader.at(key).value().is_null()) {
      throw reader.error(fmt::format("missing operand '{}'", key), "every operator needs something to work on");
    }
    return read(reader.at(key));
  }

  int read_vertical(const JsonReader& reader) {
    reader.allow({"top", "bottom", "thickness"});
    const int top = read_operand(reader, "top");
    if (!reader.has("bottom") || reader.at("bottom").value().is_null()) {
      throw reader.error("a vertical operator over nothing", "add 'bottom', or leave the operator out");
    }
    const int bottom = read(reader.at("bottom"));
    const double thickness = reader.has("thickness") ? number_between(reader.at("thickness"), 0.0, 1e6) : -1.0;
    return add({.kind = Operator::vertical, .first = top, .second = bottom, .amount = thickness}, reader);
  }

  int read_pair(const JsonReader& reader, Operator kind, const char* first, const char* second, const char* amount) {
    reader.allow({first, second, amount});
    const int a = read_operand(reader, first), b = read_operand(reader, second);
    return add({.kind = kind, .first = a, .second = b, .amount = number_between(reader.at(amount), 0.0, 1.0)}, reader);
  }

  int read_unreal(const JsonReader& reader) {
    const std::string model = reader.at("model").text();
    const std::size_t before = tree.nodes.size();
    int index = -1;
    std::string known;
    const auto read_as = [&]<class M>(const M&) {
      const std::string name(unreal_slab_name<M>);
      known += (known.empty() ? "" : ", ") + name;
      if (name != model) return;
      std::vector<std::string> keys{"model"};
      for (const ParameterInfo& info : describe_parameters<M>()) keys.emplace_back(info.name);
      allow_keys(reader, keys);
      auto pins = default_parameters<M>();
      read_values<M>(reader, pins);
      index = add_unreal_slabs(tree, pins);
    };
    std::apply([&](const auto&... models) { (read_as(models), ...); }, UnrealSlabModels{});
    if (index < 0) throw reader.at("model").error("no slabs are known for '" + model + "'", "choose one of " + known);
    for (std::size_t i = before; i < tree.nodes.size(); ++i) tree.nodes[i].path = reader.path();
    return index;
  }

  int read_name(const JsonReader& reader) {
    const std::string name = reader.text();
    const auto found = named_.find(name);
    if (found == named_.end()) {
      std::vector<std::string> names;
      for (const auto& [known, ignored] : named_) names.push_back(known);
      throw reader.error("no node is named '" + name + "'",
                         names.empty() ? "add it to \"nodes\"" : "did you mean '" + nearest_name(name, names) + "'?");
    }
    return read_named(found->first, found->second, reader);
  }

  /// `user` is where the name stands.
  int read_named(const std::string& name, const JsonReader& reader, const JsonReader& user) {
    if (const auto done = finished_.find(name); done != finished_.end()) return done->second;
    if (std::find(open_.begin(), open_.end(), name) != open_.end()) {
      open_.push_back(name);
      throw user.error(fmt::format("a cycle: {}", fmt::join(open_, " → ")), "a node can't contain itself");
    }
    open_.push_back(name);
    const int index = read(reader);
    open_.pop_back();
    finished_.emplace(name, index);
    return index;
  }

  std::map<std::string, JsonReader> named_;
  std::map<std::string, int> finished_;
  std::vector<std::string> open_;
  int depth_ = 0;
};

}  // namespace

SlabTree tree_from_json(const JsonReader& reader) {
  TreeReader nodes(reader);
  if (reader.has("thin")) nodes.tree.thin = reader.at("thin").boolean();
  for (const char* key : {"$schema", "title", "description"}) {
    if (reader.has(key)) reader.at(key).text();
  }
  if (reader.has("title")) nodes.tree.title = reader.at("title").text();
  nodes.tree.root = nodes.read(reader);
  nodes.read_unused();
  // Counted before shared nodes are copied: a few dozen lines can name 2^30 of them. What selections leave out is
  // copied when a tree is written or drawn.
  struct Count {
    double walked = 0.0, written = 0.0;
  };
  std::vector<Count> counts(nodes.tree.nodes.size());
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const TreeNode& node = nodes.tree.nodes[i];
    const auto of = [&](int operand) { return operand < 0 ? Count{} : counts[static_cast<std::size_t>(operand)]; };
    const Count first = of(node.first), second = of(node.second);
    if (node.kind == Operator::slab) {
      counts[i] = {1.0, 1.0};
    } else if (node.kind == Operator::select) {
      counts[i] = {node.amount < 0.5 ? first.walked : second.walked, first.written + second.written};
    } else {
      counts[i] = {first.walked + second.walked, first.written + second.written};
    }
  }
  const Count count = counts[static_cast<std::size_t>(nodes.tree.root)];
  if (count.walked > static_cast<double>(most_closures)) {
    throw reader.error(fmt::format("{} slabs, and at most {} closures are supported", count.walked, most_closures),
                       "merge or leave out some");
  }
  constexpr double most_written = 64;
  if (count.written > most_written) {
    throw reader.error(fmt::format("{} slabs with those that selections leave out, and at most {} are supported",
                                   count.written, most_written),
                       "select between fewer");
  }
  return nodes.tree;
}

SlabTree read_tree(const std::filesystem::path& path) {
  const Json json = parse_json(read_file(path), path.string());
  SlabTree tree = tree_from_json(JsonReader(json, path.string()));
  if (tree.title.empty()) tree.title = path.stem().string();
  return tree;
}

Json slab_json(const SlabValues& slab) {
  SlabValues given = slab;
  Json json = Json::object();
  Slab::describe(given, [&](auto& member, const ParameterInfo& info) {
    const std::string name(info.name);
    if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
      if (member.x != info.initial || member.y != info.initial || member.z != info.initial) {
        json[name] = {member.x, member.y, member.z};
      }
    } else if (member != info.initial) {
      if (info.choices.empty()) {
        json[name] = member;
      } else {
        json[name] = info.choices[static_cast<std::size_t>(member)];
      }
    }
  });
  return json;
}

namespace {

Json profile_json(const SpecularProfile& profile) {
  Json table = Json::array();
  for (std::size_t view = 0; view < profile.views; ++view) {
    Json row = Json::array();
    for (std::size_t light = 0; light < profile.lights; ++light) {
      const Rgb& tint = profile.entry(view, light);
      row.push_back({tint.x, tint.y, tint.z});
    }
    table.push_back(std::move(row));
  }
  return {{"table", std::move(table)}};
}

Json node_json(const SlabTree& tree, int index) {
  const TreeNode& node = tree.node(index);
  const auto operand = [&](int number) { return node_json(tree, number); };
  switch (node.kind) {
    case Operator::slab: {
      Json slab = Json::object();
      if (!node.name.empty()) slab["name"] = node.name;
      slab.update(slab_json(node.slab));
      if (node.profile) slab["specular_profile"] = profile_json(*node.profile);
      return {{"slab", slab}};
    }
    case Operator::vertical: {
      Json vertical{{"top", operand(node.first)}, {"bottom", operand(node.second)}};
      if (node.amount >= 0.0) vertical["thickness"] = node.amount;
      return {{"vertical", vertical}};
    }
    case Operator::horizontal:
      return {{"horizontal",
               {{"background", operand(node.first)}, {"foreground", operand(node.second)}, {"mix", node.amount}}}};
    case Operator::coverage: return {{"coverage", {{"operand", operand(node.first)}, {"weight", node.amount}}}};
    case Operator::select:
      return {{"select", {{"a", operand(node.first)}, {"b", operand(node.second)}, {"mask", node.amount}}}};
  }
  return {};
}

}  // namespace

Json tree_json(const SlabTree& tree) {
  Json json = node_json(tree, tree.root);
  if (tree.thin) json["thin"] = true;
  return json;
}

}  // namespace lobefit
