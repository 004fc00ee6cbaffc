#include "reference/layered/layer_stack.h"

#include <fmt/format.h>

namespace lobefit {

namespace {

double checked_number(const JsonReader& reader, double lower, double upper, const char* mend) {
  const double value = reader.number();
  if (!(value >= lower && value <= upper)) throw reader.error(fmt::format("{} is out of range", value), mend);
  return value;
}

double albedo_number(const JsonReader& reader) { return checked_number(reader, 0.0, 1.0, "choose one from 0 to 1"); }

double positive_number(const JsonReader& reader) {
  const double value = reader.number();
  if (!(value > 0.0 && std::isfinite(value))) {
    throw reader.error(fmt::format("{} is not a positive number", value), "choose one above 0");
  }
  return value;
}

double extinction_number(const JsonReader& reader) {
  const double value = reader.number();
  if (!(value >= 0.0 && std::isfinite(value))) {
    throw reader.error(fmt::format("{} is negative or infinite", value), "choose a number of at least 0");
  }
  return value;
}

template <class Read>
Rgb read_rgb(const JsonReader& reader, Read&& read) {
  if (!reader.value().is_array()) {
    const double value = read(reader);
    return {value, value, value};
  }
  const std::vector<JsonReader> elements = reader.elements();
  if (elements.size() != 3) throw reader.error("expected one number or three", "write a number or [r, g, b]");
  return {read(elements[0]), read(elements[1]), read(elements[2])};
}

double read_alpha(const JsonReader& reader) {
  if (!reader.has("alpha")) return 0.0;
  const JsonReader member = reader.at("alpha");
  const double value = checked_number(member, 0.0, 1.0, "choose 0 (smooth) or one from 0.0001 to 1");
  if (value > 0.0 && value < 1e-4) {
    throw member.error(fmt::format("{} is out of range", value), "choose 0 (smooth) or one from 0.0001 to 1");
  }
  return value;
}

bool read_all_bounces(const JsonReader& reader) {
  if (!reader.has("bounces")) return true;
  const JsonReader member = reader.at("bounces");
  if (member.value().is_number() && member.number() == 1.0) return false;
  if (member.value().is_string() && member.text() == "all") return true;
  throw member.error("unknown number of bounces", "write 1 or \"all\"");
}

InterfaceLayer read_interface(const JsonReader& reader) {
  reader.allow({"ior", "alpha", "bounces"});
  return {.ior = checked_number(reader.at("ior"), 1.0, 100.0, "choose one from 1 (air) to 100"),
          .alpha = read_alpha(reader),
          .all_bounces = read_all_bounces(reader)};
}

MediumLayer read_medium(const JsonReader& reader) {
  reader.allow({"mean_free_path", "albedo", "g", "thickness"});
  MediumLayer medium{.mean_free_path = read_rgb(reader.at("mean_free_path"), positive_number),
                     .albedo = read_rgb(reader.at("albedo"), albedo_number),
                     .thickness = extinction_number(reader.at("thickness"))};
  if (reader.has("g")) {
    const JsonReader g = reader.at("g");
    medium.g = g.number();
    if (!(std::abs(medium.g) < 1.0)) {
      throw g.error(fmt::format("{} is out of range", medium.g), "choose one between -1 and 1, both excluded");
    }
  }
  const Rgb depth = medium.thickness / medium.mean_free_path;
  if (!std::isfinite(depth.x + depth.y + depth.z)) {
    throw reader.error("the medium is infinitely many mean free paths thick", "choose a smaller thickness");
  }
  return medium;
}

DiffuseLayer read_diffuse(const JsonReader& reader) {
  reader.allow({"albedo", "alpha"});
  return {.albedo = read_rgb(reader.at("albedo"), albedo_number), .alpha = read_alpha(reader)};
}

ConductorLayer read_conductor(const JsonReader& reader) {
  reader.allow({"f0", "eta", "k", "alpha", "bounces"});
  ConductorLayer conductor{
      .by_f0 = reader.has("f0"), .alpha = read_alpha(reader), .all_bounces = read_all_bounces(reader)};
  if (conductor.by_f0) {
    if (reader.has("eta") || reader.has("k")) throw reader.error("f0 and eta, k together", "keep f0, or eta and k");
    conductor.f0 = read_rgb(reader.at("f0"), albedo_number);
    return conductor;
  }
  if (!reader.has("eta")) throw reader.error("missing 'f0', or 'eta' and 'k'", "add f0, or eta and k");
  conductor.eta = read_rgb(reader.at("eta"), positive_number);
  conductor.k = read_rgb(reader.at("k"), extinction_number);
  return conductor;
}

/// The one member of an object that names its kind.
std::pair<std::string, JsonReader> read_kind(const JsonReader& reader, std::initializer_list<std::string_view> kinds) {
  reader.allow(kinds);
  auto members = reader.members();
  if (members.size() != 1) {
    throw reader.error(fmt::format("expected one of {}", fmt::join(kinds, ", ")), "write {\"interface\": { … }}");
  }
  return members.front();
}

SlabLayer read_slab(const JsonReader& reader) {
  reader.allow({"coverage", "layers"});
  SlabLayer slab{.coverage = albedo_number(reader.at("coverage"))};
  const std::vector<JsonReader> elements = reader.at("layers").elements();
  if (elements.empty()) throw reader.at("layers").error("the list is empty", "add an interface or a medium");
  for (const JsonReader& element : elements) {
    const auto [kind, member] = read_kind(element, {"interface", "medium"});
    if (kind == "interface") {
      slab.layers.emplace_back(read_interface(member));
    } else {
      slab.layers.emplace_back(read_medium(member));
    }
  }
  return slab;
}

/// Puts one outcome together, layer by layer.
class EventBuilder {
 public:
  void add(const InterfaceLayer& layer) {
    event_.boundaries.push_back({layer, ior_, layer.ior});
    ior_ = layer.ior;
    event_.regions.push_back({.ior = ior_});
    empty_ = true;
  }
  void add(const MediumLayer& layer) {
    if (!empty_) {
      event_.boundaries.push_back({LayerEvent::Nothing{}, ior_, ior_});
      event_.regions.push_back({.ior = ior_});
    }
    LayerEvent::Region& region = event_.regions.back();
    region.optical_depth = layer.thickness / layer.mean_free_path;
    region.albedo = layer.albedo;
    region.g = layer.g;
    empty_ = false;
  }
  LayerEvent finish(const BottomLayer& bottom, double probability) {
    std::visit([&](const auto& layer) { event_.boundaries.push_back({layer, ior_, ior_}); }, bottom);
    if (const auto* layer = std::get_if<InterfaceLayer>(&bottom)) event_.boundaries.back().ior_below = layer->ior;
    event_.probability = probability;
    return std::move(event_);
  }

 private:
  LayerEvent event_;
  double ior_ = 1.0;
  bool empty_ = false;  // the last region has no medium yet
};

bool equal_channels(const Rgb& value) { return value.x == value.y && value.y == value.z; }

}  // namespace

bool LayerEvent::shared_extinction() const {
  return std::all_of(regions.begin(), regions.end(),
                     [](const Region& region) { return equal_channels(region.optical_depth); });
}

bool LayerEvent::grey() const {
  const auto grey_region = [](const Region& region) {
    return equal_channels(region.optical_depth) && equal_channels(region.albedo);
  };
  const auto grey_boundary = [](const Boundary& boundary) {
    if (const auto* diffuse = std::get_if<DiffuseLayer>(&boundary.layer)) return equal_channels(diffuse->albedo);
    const auto* conductor = std::get_if<ConductorLayer>(&boundary.layer);
    return !conductor ||
           (equal_channels(conductor->f0) && equal_channels(conductor->eta) && equal_channels(conductor->k));
  };
  return std::all_of(regions.begin(), regions.end(), grey_region) &&
         std::all_of(boundaries.begin(), boundaries.end(), grey_boundary);
}

LayerStack LayerStack::from_json(const JsonReader& reader) {
  reader.allow({"$schema", "layers"});
  const JsonReader list = reader.at("layers");
  const std::vector<JsonReader> elements = list.elements();
  if (elements.empty()) throw list.error("the list is empty", "add at least a bottom: diffuse, conductor or interface");
  LayerStack stack;
  std::size_t partial_slabs = 0;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const bool last = i + 1 == elements.size();
    const auto [kind, member] = read_kind(elements[i], {"interface", "medium", "slab", "diffuse", "conductor"});
    if ((kind == "diffuse" || kind == "conductor") && !last) {
      throw elements[i].error("layers below an opaque " + kind, "remove what follows it");
    }
    if ((kind == "medium" || kind == "slab") && last) {
      throw elements[i].error("the stack has no bottom", "end it with diffuse, conductor or interface");
    }
    if (kind == "interface") {
      const InterfaceLayer layer = read_interface(member);
      if (last) {
        stack.bottom = layer;
      } else {
        stack.layers.emplace_back(layer);
      }
    } else if (kind == "medium") {
      stack.layers.emplace_back(read_medium(member));
    } else if (kind == "slab") {
      const SlabLayer slab = read_slab(member);
      if (slab.coverage > 0.0 && slab.coverage < 1.0 && ++partial_slabs > most_partial_slabs) {
        throw member.error(fmt::format("more than {} slabs of partial coverage", most_partial_slabs),
                           "every one doubles the work: merge some, or set their coverage to 0 or 1");
      }
      stack.layers.emplace_back(slab);
    } else if (kind == "diffuse") {
      stack.bottom = read_diffuse(member);
    } else {
      stack.bottom = read_conductor(member);
    }
  }
  return stack;
}

std::vector<LayerEvent> LayerStack::events() const {
  std::vector<bool> present(layers.size(), true);
  std::vector<std::size_t> partial;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const auto* slab = std::get_if<SlabLayer>(&layers[i]);
    if (!slab) continue;
    present[i] = slab->coverage > 0.0;
    if (slab->coverage > 0.0 && slab->coverage < 1.0) partial.push_back(i);
  }
  std::vector<LayerEvent> result;
  for (std::size_t outcome = 0; outcome < (std::size_t{1} << partial.size()); ++outcome) {
    double probability = 1.0;
    for (std::size_t k = 0; k < partial.size(); ++k) {
      const double coverage = std::get<SlabLayer>(layers[partial[k]]).coverage;
      present[partial[k]] = ((outcome >> k) & 1) != 0;
      probability *= present[partial[k]] ? coverage : 1.0 - coverage;
    }
    EventBuilder builder;
    const auto add = [&](const auto& layer) { builder.add(layer); };
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (!present[i]) continue;
      if (const auto* slab = std::get_if<SlabLayer>(&layers[i])) {
        for (const CoatLayer& layer : slab->layers) std::visit(add, layer);
      } else if (const auto* medium = std::get_if<MediumLayer>(&layers[i])) {
        builder.add(*medium);
      } else {
        builder.add(std::get<InterfaceLayer>(layers[i]));
      }
    }
    result.push_back(builder.finish(bottom, probability));
  }
  return result;
}

}  // namespace lobefit
