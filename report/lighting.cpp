#include "report/lighting.h"

#include <string>

#include "models/error.h"

namespace lobefit {

Direction direction_in_picture(double theta, double phi) { return direction(radians(theta), radians(phi)); }

Rgb Lighting::radiance(const Direction& w) const {
  Rgb sum = constant;
  for (const LightLobe& lobe : lobes) {
    double power = max(dot(lobe.axis, w), 0.0);
    for (int k = 0; k < lobe.sharpness; ++k) power *= power;
    sum = sum + lobe.peak * power;
  }
  return sum;
}

Lighting Lighting::directional(double theta, double phi) {
  return {.lights = {{direction_in_picture(theta, phi), Rgb{pi, pi, pi}}}};
}

Lighting Lighting::three_lights() {
  const auto white = [](double irradiance) { return Rgb{irradiance, irradiance, irradiance}; };
  return {.lights = {{direction_in_picture(40.0, 135.0), white(pi)},
                     {direction_in_picture(60.0, -15.0), white(0.3 * pi)},
                     {direction_in_picture(125.0, 60.0), white(pi)}}};
}

Lighting Lighting::environment() {
  // Lobes no sharper than cos^16: renders resolve them with few nodes even on rough surfaces.
  return {.constant = {0.25, 0.25, 0.25},
          .lobes = {{{0.0, 1.0, 0.0}, {0.5, 0.55, 0.65}, 1},
                    {direction_in_picture(55.0, 145.0), {3.0, 3.0, 2.8}, 4},
                    {direction_in_picture(75.0, -10.0), {1.2, 0.9, 0.6}, 4}}};
}

Lighting find_lighting(std::string_view name) {
  if (name == "directional") return Lighting::directional(45.0, 135.0);
  if (name == "three_lights") return Lighting::three_lights();
  if (name == "environment") return Lighting::environment();
  throw Error(ExitCode::usage, "unknown lighting '" + std::string(name) + "'", "--lighting",
              "choose directional, three_lights or environment");
}

}  // namespace lobefit
