#include "reference/substrate/physical_surface.h"

#include <fmt/format.h>

#include "models/error.h"
#include "models/substrate/conversions.h"
#include "models/substrate/diffuse_fresnel.h"

namespace lobefit {

namespace {

/// Roughness below which an interface is taken for smooth: its lobe is narrower than any grid of directions.
constexpr double smallest_rough_alpha = 1e-3;

double interface_alpha(double roughness) {
  const double alpha = roughness * roughness;
  return alpha < smallest_rough_alpha ? 0.0 : min(alpha, 1.0);
}

/// ρ below the interface from ρ as seen through it: R = (1 - F_i) ρ/(1 - F_i ρ) solved for ρ (Saunderson 1942).
Rgb bare_albedo(const Rgb& seen, double index) {
  const double inside = index > 1.0 ? diffuse_fresnel_inside(index) : 0.0;
  return seen / ((1.0 - inside) + inside * seen);
}

/// A slab of one lobe, metal or dielectric.
struct Matter {
  double probability;
  SlabValues slab;
  bool metal;
};

/// What a slab is, in parts of its area.
std::vector<Matter> matter_of(const SlabValues& slab, bool lowest) {
  std::vector<Matter> lobes;
  const double second = slab.second_roughness_weight;
  if (second < 1.0) lobes.push_back({1.0 - second, slab, false});
  if (second > 0.0) {
    lobes.push_back({second, slab, false});
    lobes.back().slab.roughness = slab.second_roughness;
  }
  if (!lowest) return lobes;
  const Metalness metalness = Metalness::of(slab);
  std::vector<Matter> result;
  for (const Matter& lobe : lobes) {
    if (metalness.metallic > 0.0) {
      Matter metal = lobe;
      metal.metal = true;
      metal.probability *= metalness.metallic;
      metal.slab.f0 = metalness.metal;
      result.push_back(metal);
    }
    if (metalness.metallic < 1.0) {
      Matter dielectric = lobe;
      dielectric.probability *= 1.0 - metalness.metallic;
      dielectric.slab.diffuse_albedo = metalness.dielectric_albedo;
      if (metalness.metallic > 0.0) dielectric.slab.f0 = {0.04, 0.04, 0.04};
      result.push_back(dielectric);
    }
  }
  return result;
}

class StackBuilder {
 public:
  explicit StackBuilder(DiffuseReading reading) : reading_(reading) {}

  void add_layer(const SlabValues& slab) {
    add_interface(slab);
    const Rgb scattering = single_scattering_albedo(slab.diffuse_albedo, slab.phase_anisotropy);
    if (slab.thickness <= 0.0) return;
    stack_.layers.emplace_back(MediumLayer{.mean_free_path = slab.mean_free_path,
                                           .albedo = scattering,
                                           .g = slab.phase_anisotropy,
                                           .thickness = slab.thickness});
  }
  LayerStack close(const Matter& lowest) && {
    const SlabValues& slab = lowest.slab;
    if (lowest.metal) {
      stack_.bottom = ConductorLayer{.f0 = slab.f0, .alpha = interface_alpha(slab.roughness)};
      return std::move(stack_);
    }
    add_interface(slab);
    const double own_index = index_of_f0(mean_channel(slab.f0));
    stack_.bottom = DiffuseLayer{reading_ == DiffuseReading::in_air ? bare_albedo(slab.diffuse_albedo, own_index)
                                                                    : slab.diffuse_albedo};
    return std::move(stack_);
  }
  /// Nothing below: light that gets there is gone.
  LayerStack close_open() && {
    stack_.bottom = DiffuseLayer{{0.0, 0.0, 0.0}};
    return std::move(stack_);
  }

 private:
  void add_interface(const SlabValues& slab) {
    const double f0 = mean_channel(slab.f0);
    if (f0 <= 0.0) return;
    const double index = min(index_of_f0(f0), 100.0);
    if (std::abs(index - index_) < 1e-6) return;
    stack_.layers.emplace_back(InterfaceLayer{.ior = index, .alpha = interface_alpha(slab.roughness)});
    index_ = index;
  }

  DiffuseReading reading_;
  LayerStack stack_;
  double index_ = 1.0;
};

}  // namespace

std::vector<PhysicalEvent> physical_events(const SlabTree& given, DiffuseReading reading) {
  const SlabTree tree = resolved(given);
  std::vector<PhysicalEvent> result;
  for (const SlabEvent& event : slab_events(tree, tree.root)) {
    // Every combination of what the slabs are.
    std::vector<std::vector<Matter>> kinds;
    std::size_t combinations = 1;
    for (const int leaf : event.leaves) {
      const SlabValues& slab = tree.node(leaf).slab;
      kinds.push_back(matter_of(slab, is_opaque(slab)));
      combinations *= kinds.back().size();
    }
    if (result.size() + combinations > most_physical_events) {
      throw Error(ExitCode::usage, fmt::format("more than {} combinations of layers", most_physical_events), "tree",
                  "use fewer partial coverages, mixes and second lobes");
    }
    for (std::size_t number = 0; number < combinations; ++number) {
      PhysicalEvent physical{.probability = event.probability};
      physical.top.fuzz_amount = 0.0;
      StackBuilder builder(reading);
      bool closed = false;
      std::size_t rest = number;
      for (std::size_t i = 0; i < kinds.size(); ++i) {
        const Matter& matter = kinds[i][rest % kinds[i].size()];
        rest /= kinds[i].size();
        physical.probability *= matter.probability;
        if (i == 0) physical.top = tree.node(event.leaves[0]).slab;
        if (is_opaque(matter.slab)) {
          physical.stack = std::move(builder).close(matter);
          closed = true;
        } else {
          builder.add_layer(matter.slab);
        }
      }
      if (!closed) physical.stack = std::move(builder).close_open();
      if (physical.probability > 0.0) result.push_back(std::move(physical));
    }
  }
  return result;
}

std::vector<std::string> physical_notes(const SlabTree& given) {
  const SlabTree tree = resolved(given);
  std::vector<std::string> notes;
  const auto note = [&](const TreeNode& node, const std::string& text) {
    notes.push_back((node.name.empty() ? node.path : node.name) + ": " + text);
  };
  std::vector<bool> topmost(tree.nodes.size(), false);
  for (const SlabEvent& event : slab_events(tree, tree.root)) {
    if (!event.leaves.empty()) topmost[static_cast<std::size_t>(event.leaves.front())] = true;
  }
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const TreeNode& node = tree.nodes[i];
    if (node.kind != Operator::slab) continue;
    const SlabValues& slab = node.slab;
    if (slab.anisotropy != 0.0) note(node, "the integrator's facets are isotropic, with the mean alpha");
    if (slab.f90.x != slab.f90.y || slab.f90.y != slab.f90.z) note(node, "no interface has a coloured F90: left out");
    if (node.profile) note(node, "no interface has a specular profile: left out");
    if (slab.fuzz_amount > 0.0 && !topmost[i]) note(node, "fuzz under a layer is left out");
    const bool coloured = slab.f0.x != slab.f0.y || slab.f0.y != slab.f0.z;
    if (coloured && !is_opaque(slab)) note(node, "a layer's interface has one index: f0 lost its colour");
  }
  return notes;
}

PhysicalSurface::PhysicalSurface(const SlabTree& tree, DiffuseReading reading) {
  for (const PhysicalEvent& event : physical_events(tree, reading)) {
    parts_.push_back({event.probability, std::make_unique<LayeredSurface>(event.stack), event.top});
  }
}

void PhysicalSurface::sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points,
                                 std::uint32_t samples, bool fast, const Line& line) const {
  std::fill(line.values.begin(), line.values.end(), Rgb{0.0, 0.0, 0.0});
  if (!(wo.z > 0.0)) return;
  std::vector<Rgb> values(wi.size());
  for (const Part& part : parts_) {
    part.stack->sample_row(wo, wi, points, samples, fast, {.values = values});
    const double amount = part.top.fuzz_amount;
    const double rest = 1.0 - amount * ZeltnerFit::Albedo::evaluate(wo.z, part.top.fuzz_roughness);
    for (std::size_t i = 0; i < wi.size(); ++i) {
      Rgb value = values[i] * rest;
      if (amount > 0.0 && wi[i].z > 0.0) {
        value = value +
                SheenZeltner::evaluate(SheenZeltner::Parameters<double>{part.top.fuzz_color, part.top.fuzz_roughness},
                                       make_geometry(wi[i], wo)) *
                    amount;
      }
      line.values[i] = line.values[i] + value * part.probability;
    }
  }
}

Rgb PhysicalSurface::sample_albedo(const Direction& wo, const SamplePoints& points, std::uint32_t samples) const {
  Rgb sum{0.0, 0.0, 0.0};
  if (!(wo.z > 0.0)) return sum;
  for (const Part& part : parts_) {
    const double fuzz = part.top.fuzz_amount * ZeltnerFit::Albedo::evaluate(wo.z, part.top.fuzz_roughness);
    const Rgb stack = part.stack->sample_albedo(wo, points, samples);
    sum = sum + (stack * (1.0 - fuzz) + part.top.fuzz_color * fuzz) * part.probability;
  }
  return sum;
}

}  // namespace lobefit
