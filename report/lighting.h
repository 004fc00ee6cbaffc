// Light for pictures of spheres: a few directional lights, and environments in closed form.
//
// World: x right, y up, z towards the viewer. Radiances are relative: a white Lambertian surface that faces one light
// of irradiance π, or sits in a constant environment of radiance 1, has radiance 1.
#pragma once

#include <array>
#include <memory>
#include <string_view>
#include <vector>

#include "models/geometry.h"
#include "report/sampled_light.h"

namespace lobefit {

struct DirectionalLight {
  Direction towards;
  Rgb irradiance;  // on a surface that faces it
};

/// Radiance peak · max(axis·w, 0)^(2^sharpness).
struct LightLobe {
  Direction axis;
  Rgb peak;
  int sharpness;
};

struct Lighting {
  std::vector<DirectionalLight> lights;
  Rgb constant;
  std::vector<LightLobe> lobes;
  std::shared_ptr<const SampledLight> sampled = nullptr;

  bool has_environment() const { return !lobes.empty() || constant.x > 0.0 || constant.y > 0.0 || constant.z > 0.0; }
  /// Of the environment in closed form.
  Rgb radiance(const Direction& w) const;

  /// One white light of irradiance π; angles in degrees as of direction_in_picture().
  static Lighting directional(double theta, double phi);
  /// A key light, a fill and one from behind, all white.
  static Lighting three_lights();
  /// A grey room with a blueish ceiling, a window and a warm lamp.
  static Lighting environment();
};

/// Polar angle from the axis to the viewer, azimuth from the right over the top, both in degrees: 0 is a lamp at the
/// camera, (45, 135) one up on the left.
Direction direction_in_picture(double theta, double phi);

/// The three that reports use, by name; `directional` is at (45, 135).
inline constexpr std::array<std::string_view, 3> lighting_names{"directional", "three_lights", "environment"};
/// Throws Error(usage) with the choices.
Lighting find_lighting(std::string_view name);

}  // namespace lobefit
