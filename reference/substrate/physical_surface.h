// What a Substrate tree would look like if it were matter: the truth that the tree, and every simplification of it, is
// held to.
//
// Every outcome of the tree's coverages and mixes, of second lobes and of metalness is a stack of interfaces and media
// for the layered integrator, and the surface is their expectation: patches wider than a path. How slabs are read:
//   - An interface is a dielectric of the index that gives the mean of f0, or at the bottom, by the metalness that
//   would
//     have made the slab, a conductor of Schlick's reflectance. f0 = 0 is no interface.
//   - Between two slabs the interface is that of their two indices: none at all where these agree. (Substrate gives
//     each slab its own, as if air were between.)
//   - Media have the single-scattering albedo that the diffuse albedo stands for, by the published inversion.
//   - An opaque body is Lambertian. S2 calls its diffuse albedo what is seen after multiple scattering: `in_air` takes
//   it
//     for what the slab shows in air under a smooth interface of its own, so that a slab alone is right by definition,
//     and layers are what is judged; `bare` takes it for what lies below the interface. Without an interface, f0 = 0,
//     both are one.
//   - Fuzz of the topmost slab lies over all, as the model has it. What no stack can hold is listed by notes().
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "models/substrate/walk.h"
#include "reference/layered/layered_surface.h"

namespace lobefit {

enum class DiffuseReading { in_air, bare };
inline constexpr std::array<std::string_view, 2> diffuse_reading_names{"in_air", "bare"};

/// One outcome: a stack, and the slab whose fuzz lies on it.
struct PhysicalEvent {
  double probability = 1.0;
  LayerStack stack;
  SlabValues top{};
};

/// All outcomes; probabilities add up to 1. Throws Error(usage) beyond `most_physical_events`.
inline constexpr std::size_t most_physical_events = 256;
std::vector<PhysicalEvent> physical_events(const SlabTree& tree, DiffuseReading reading = DiffuseReading::in_air);
/// What the stacks leave out of a tree, in words.
std::vector<std::string> physical_notes(const SlabTree& tree);

class PhysicalSurface : public Integrator {
 public:
  explicit PhysicalSurface(const SlabTree& tree, DiffuseReading reading = DiffuseReading::in_air);

  int channels() const override { return 3; }
  void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points, std::uint32_t samples,
                  bool fast, const Line& line) const override;
  /// Directional albedo with the view at wo, mirror images included.
  Rgb sample_albedo(const Direction& wo, const SamplePoints& points, std::uint32_t samples) const;

 private:
  struct Part {
    double probability;
    std::unique_ptr<LayeredSurface> stack;
    SlabValues top;
  };
  std::vector<Part> parts_;
};

}  // namespace lobefit
