// From other ways to describe a material to a slab's parameters: Substrate's helper nodes.
#pragma once

#include "models/specular/haze.h"
#include "models/substrate/tree.h"

namespace lobefit {

/// Metalness-To-DiffuseColorF0: diffuse = base (1 - M), F0 = lerp(.08 specular, base, M).
inline void set_metalness(SlabValues& slab, const Rgb& base_color, double metallic, double specular) {
  slab.diffuse_albedo = base_color * (1.0 - metallic);
  const double dielectric = 0.08 * specular;
  slab.f0 = base_color * metallic + dielectric * (1.0 - metallic);
}

/// The metalness that would have made a slab, by its channels' means, and the metal's colour; 0 where F0 alone could be
/// a dielectric's (index up to 2.3). The inverse of set_metalness() at specular = ½.
struct Metalness {
  double metallic = 0.0;
  Rgb metal{0.0, 0.0, 0.0}, dielectric_albedo{0.0, 0.0, 0.0};

  static Metalness of(const SlabValues& slab) {
    constexpr double dielectric = 0.04, largest_dielectric = 0.16;
    const double f0 = mean_channel(slab.f0), diffuse = mean_channel(slab.diffuse_albedo);
    if (f0 <= largest_dielectric) return {0.0, {}, slab.diffuse_albedo};
    if (diffuse <= 0.0) return {1.0, slab.f0, {}};
    // f0 = .04 (1 - M) + diffuse M/(1 - M) grows with M.
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 60; ++i) {
      const double m = 0.5 * (low + high);
      (dielectric * (1.0 - m) + diffuse * m / (1.0 - m) < f0 ? low : high) = m;
    }
    const Rgb metal = (slab.f0 - dielectric * (1.0 - low)) / max(low, 1e-9);
    const auto clamped = [](const Rgb& c) { return Rgb{saturate(c.x), saturate(c.y), saturate(c.z)}; };
    return {low, clamped(metal), clamped(slab.diffuse_albedo / (1.0 - low))};
  }
};

/// Longest mean free path that conversions give, cm: a medium that is practically clear.
inline constexpr double longest_mean_free_path = 1e6;

/// Transmittance-To-MeanFreePath: thickness/(-ln T); 0, opaque, where nothing passes.
inline Rgb mean_free_path_of(const Rgb& transmittance, double thickness) {
  const auto one = [&](double t) {
    if (t <= 0.0) return 0.0;
    return t >= 1.0 ? longest_mean_free_path : min(thickness / -std::log(t), longest_mean_free_path);
  };
  return {one(transmittance.x), one(transmittance.y), one(transmittance.z)};
}

/// Haziness-To-SecondaryRoughness: Barla's wide lobe and weight. F0 then means the reflectance with haze.
inline void set_haziness(SlabValues& slab, double haziness, double extent) {
  const Haze<double> haze(slab.f0, square(slab.roughness), haziness, extent);
  slab.f0 = slab.f0 * haze.gain;
  slab.second_roughness = std::sqrt(haze.wide_alpha);
  slab.second_roughness_weight = haze.weight;
}

}  // namespace lobefit
