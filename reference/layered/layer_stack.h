// Plane-parallel layers, top to bottom: what the layered reference integrates.
//
//   {"layers": [
//     {"interface": {"ior": 1.5, "alpha": 0.1, "bounces": "all"}},
//     {"medium": {"mean_free_path": [1, 1, 2], "albedo": 0.9, "g": 0.3, "thickness": 0.5}},
//     {"diffuse": {"albedo": [0.8, 0.5, 0.2]}}]}
//
// An interface's ior is the index of refraction of what lies below it; above the first is air, 1. The last layer is the
// bottom: `diffuse`, `conductor`, or an `interface` whose transmitted light is gone. `{"slab": {"coverage": c,
// "layers": [...]}}` groups interfaces and media that are all present with probability c and all absent otherwise:
// where they are absent, what is below sees the index above the slab. Slabs are independent of each other, and of
// light: the answer is the expectation over their 2^k events, which is right where patches are larger than a path is
// wide.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "models/scalar.h"
#include "reference/json_reader.h"

namespace lobefit {

/// Smooth (alpha 0) or rough: facets with a GGX distribution.
struct InterfaceLayer {
  double ior = 1.5;  // absolute, of what is below; at least 1
  double alpha = 0.0;
  bool all_bounces = true;  // else light that meets a second facet is lost
};

/// Homogeneous, with a Henyey-Greenstein phase function.
struct MediumLayer {
  Rgb mean_free_path{1.0, 1.0, 1.0};  // in the unit of the thickness
  Rgb albedo;                         // of single scattering
  double g = 0.0;                     // mean cosine of the scattering angle
  double thickness = 0.0;
};

/// Lambertian: plain (alpha 0), or facets with a GGX distribution, one bounce.
struct DiffuseLayer {
  Rgb albedo;
  double alpha = 0.0;
};

/// Schlick's reflectance of f0, whatever is above; or eta + i k in vacuum, so that what is above matters.
struct ConductorLayer {
  bool by_f0 = true;
  Rgb f0, eta, k;
  double alpha = 0.0;
  bool all_bounces = true;
};

using CoatLayer = std::variant<InterfaceLayer, MediumLayer>;

/// Layers that are present together with probability `coverage`.
struct SlabLayer {
  double coverage = 1.0;
  std::vector<CoatLayer> layers;
};

using BottomLayer = std::variant<DiffuseLayer, ConductorLayer, InterfaceLayer>;

/// One outcome of all coverage events, as boundaries 0 … n and the regions between them: region k is between boundaries
/// k and k + 1.
struct LayerEvent {
  struct Nothing {};  // media meet, or a medium lies bare
  struct Boundary {
    std::variant<Nothing, InterfaceLayer, DiffuseLayer, ConductorLayer> layer;
    double ior_above = 1.0, ior_below = 1.0;
  };
  struct Region {
    double ior = 1.0;
    Rgb optical_depth, albedo;  // 0 where nothing is between the boundaries
    double g = 0.0;
  };

  double probability = 1.0;
  std::vector<Boundary> boundaries;
  std::vector<Region> regions;

  /// Red, green and blue travel alike: no optical depth differs.
  bool shared_extinction() const;
  /// Nothing differs between red, green and blue.
  bool grey() const;
};

struct LayerStack {
  /// Two to the power of this many events at most.
  static constexpr std::size_t most_partial_slabs = 8;

  std::vector<std::variant<InterfaceLayer, MediumLayer, SlabLayer>> layers;  // above the bottom
  BottomLayer bottom;

  /// Throws Error(invalid_input) with the path of what is wrong.
  static LayerStack from_json(const JsonReader& reader);

  /// All outcomes of positive probability; the probabilities sum to 1.
  std::vector<LayerEvent> events() const;
};

}  // namespace lobefit
