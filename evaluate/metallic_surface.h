// Albedo and f0 as Unreal's base colour, Metallic and Specular have them between them.
#pragma once

#include <array>

namespace lobefit {

/// Reflectance of a dielectric whose Specular is 1.
inline constexpr double largest_dielectric_f0 = 0.08;

struct MetallicSurface {
  using Color = std::array<double, 3>;

  Color base_color{};
  double dielectric_f0 = 0.0;  // .08 Specular
  double metallic = 0.0;

  /// The engine's DecodeGBufferData and ComputeF0. Exactly base colour and dielectric_f0 where metallic is 0.
  Color albedo() const;
  Color f0() const;

  /// The one with metallic a multiple of 1/255 that has the smallest sum of squared differences in albedo and f0, all
  /// six numbers being reflectances; the least metallic of several.
  static MetallicSurface nearest(const Color& albedo, const Color& f0);
};

}  // namespace lobefit
