#include "fit/substrate_pairs.h"

#include "models/substrate/conversions.h"
#include "reference/substrate/physical_surface.h"

namespace lobefit {

namespace {

constexpr double coat_thickness = 0.01;  // cm; depths alone matter

/// Numbers of one pair, one after the other.
class Draws {
 public:
  Draws(std::uint64_t seed, std::uint32_t number)
      : points_(Sampler::philox, {.seed = seed, .entry = 0x736c616273ull}), numbers_(points_, number) {}
  double between(double low, double high) { return lerp(low, high, numbers_.next()); }
  bool chance(double probability) { return numbers_.next() < probability; }
  Rgb color(double low, double high) {
    const double r = between(low, high), g = between(low, high);
    return {r, g, between(low, high)};
  }

 private:
  SamplePoints points_;
  PathNumbers numbers_;
};

/// A conductor or a diffuse slab, half each.
void draw_opaque(Draws& draws, SlabValues& slab, bool& conductor) {
  conductor = draws.chance(0.5);
  const Rgb metal = draws.color(0.4, 1.0), body = draws.color(0.02, 0.95);
  const double f0 = draws.chance(0.5) ? 0.04 : 0.0;
  slab.f0 = conductor ? metal : Rgb{f0, f0, f0};
  slab.diffuse_albedo = conductor ? Rgb{0.0, 0.0, 0.0} : body;
  slab.roughness = draws.between(0.1, 1.0);
  slab.thickness = 0.0;
}

/// The views' directional albedos in place of BRDFs.
class AlbedoOfViews : public Integrator {
 public:
  explicit AlbedoOfViews(const SlabTree& tree) : surface_(tree) {}
  int channels() const override { return 3; }
  void sample_row(const Direction& wo, std::span<const Direction>, const SamplePoints& points, std::uint32_t samples,
                  bool, const Line& line) const override {
    std::fill(line.values.begin(), line.values.end(), surface_.sample_albedo(wo, points, samples));
  }

 private:
  PhysicalSurface surface_;
};

SlabTree drawn_tree(const ParameterValues& values) {
  return LayeredPair::draw(static_cast<std::uint64_t>(values.get("pairs_seed")),
                           static_cast<std::uint32_t>(values.get("pair")))
      .tree();
}

std::vector<ParameterInfo> pair_parameters() {
  return {{.name = "pairs_seed", .upper = 1e9, .initial = 1.0, .doc = "Seed of the pairs.", .offset = 0},
          {.name = "pair", .upper = 1e9, .doc = "Number of the pair.", .offset = 1}};
}

}  // namespace

LayeredPair LayeredPair::draw(std::uint64_t seed, std::uint32_t number) {
  Draws draws(seed, number);
  LayeredPair pair{.top = default_slab(), .bottom = default_slab()};
  SlabValues& top = pair.top;
  const bool interface = draws.chance(0.85);
  const double f0 = f0_of_index(draws.between(1.3, 1.7));
  top.f0 = interface ? Rgb{f0, f0, f0} : Rgb{0.0, 0.0, 0.0};
  pair.smooth = draws.chance(1.0 / 3.0) || !interface;
  const double roughness = draws.between(0.1, 0.7);
  top.roughness = pair.smooth ? 0.03 : roughness;
  top.thickness = coat_thickness;
  const double kind = draws.between(0.0, 3.0);
  pair.medium = !interface || kind > 2.0 ? Medium::scattering : kind > 1.0 ? Medium::absorbing : Medium::clear;
  top.diffuse_albedo = {0.0, 0.0, 0.0};
  const Rgb transmittance = draws.color(0.2, 1.0);
  const double depth = draws.between(0.1, 3.0), phase = draws.between(-0.2, 0.8);
  const Rgb milk = draws.color(0.1, 0.95);
  switch (pair.medium) {
    case Medium::clear: top.mean_free_path = mean_free_path_of({1.0, 1.0, 1.0}, coat_thickness); break;
    case Medium::absorbing: top.mean_free_path = mean_free_path_of(transmittance, coat_thickness); break;
    case Medium::scattering: {
      const double mean_free_path = coat_thickness / depth;
      top.mean_free_path = {mean_free_path, mean_free_path, mean_free_path};
      top.diffuse_albedo = milk;
      top.phase_anisotropy = phase;
    }
  }
  draw_opaque(draws, pair.bottom, pair.conductor);
  return pair;
}

SlabTree LayeredPair::tree() const {
  SlabTree tree;
  const int upper = tree.add_slab(top, "top"), lower = tree.add_slab(bottom, "bottom");
  tree.root = tree.add_vertical(upper, lower, top.thickness);
  return tree;
}

MixedPair MixedPair::draw(std::uint64_t seed, std::uint32_t number) {
  Draws draws(seed, number ^ 0x80000000u);
  MixedPair pair{.background = default_slab(), .foreground = default_slab()};
  for (SlabValues* slab : {&pair.background, &pair.foreground}) {
    bool conductor = false;
    draw_opaque(draws, *slab, conductor);
    const double f0 = draws.between(0.02, 0.08);
    if (!conductor) slab->f0 = {f0, f0, f0};
  }
  pair.mix = draws.between(0.05, 0.95);
  return pair;
}

SlabTree MixedPair::tree() const {
  SlabTree tree;
  const int a = tree.add_slab(background, "background"), b = tree.add_slab(foreground, "foreground");
  tree.root = tree.add_horizontal(a, b, mix);
  return tree;
}

Grid pair_grid() {
  return {.theta_i = {"theta_i", "degree", {2.0, 15.0, 30.0, 45.0, 60.0, 75.0}},
          .theta_o = {"theta_o", "degree", {2.0, 30.0, 60.0, 75.0}},
          .phi = {"phi", "degree", {0.0, 60.0, 120.0, 160.0, 180.0}}};
}

Grid pair_views() {
  Grid grid = pair_grid();
  grid.theta_i.values = {0.0};
  grid.phi.values = {0.0};
  return grid;
}

Reference layered_pair_reference() {
  return {.name = "slab_pair",
          .doc = "Two Substrate slabs, one on the other, by the layered integrator.",
          .source = "Guo, Hašan, Zhao 2018",
          .parameters = pair_parameters(),
          .make = [](const ParameterValues& values) -> std::unique_ptr<const Integrator> {
            return std::make_unique<PhysicalSurface>(drawn_tree(values));
          }};
}

Reference layered_pair_albedo_reference() {
  Reference reference = layered_pair_reference();
  reference.name = "slab_pair_albedo";
  reference.doc = "Directional albedo of two Substrate slabs, one on the other.";
  reference.make = [](const ParameterValues& values) -> std::unique_ptr<const Integrator> {
    return std::make_unique<AlbedoOfViews>(drawn_tree(values));
  };
  return reference;
}

}  // namespace lobefit
