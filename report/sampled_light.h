// Light that has no closed form under a BRDF: pictures of spheres draw samples of it.
//
//   Lighting lighting{.sampled = std::make_shared<EnvironmentMap>(read_environment("studio.exr", 0.0))};
//
// World as in lighting.h: x right, y up, z towards the viewer.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "models/geometry.h"

namespace lobefit {

/// Light from a direction, and the density per solid angle with which it is drawn.
struct ArrivingLight {
  Rgb radiance;
  double pdf;
};

class SampledLight {
 public:
  virtual ~SampledLight() = default;
  virtual ArrivingLight at(const Direction& w) const = 0;
  /// A direction with density at().pdf, u in [0, 1)².
  virtual Direction sample(const std::array<double, 2>& u) const = 0;
};

/// A round white light far away, of irradiance π on a surface that faces it; angles in degrees as of
/// direction_in_picture(), `radius` that of its disk.
class DiskLight : public SampledLight {
 public:
  /// Throws Error(usage) for a radius outside (0, 90].
  DiskLight(double theta, double phi, double radius);

  ArrivingLight at(const Direction& w) const override;
  Direction sample(const std::array<double, 2>& u) const override;

 private:
  Direction axis_, across_, up_;
  double cosine_, one_minus_cosine_;
};

/// A lat-long picture, in OpenEXR's convention: lines go from +y down to -y, the middle column is seen towards +z (so
/// that what stands there is behind the camera and lights the visible face), the column a quarter from the left towards
/// +x. Pixels are areas of constant radiance; they are drawn in proportion to the light that they send.
class EnvironmentMap : public SampledLight {
 public:
  /// `rgb` [line][column][channel], linear Rec.709; negative values count as 0. `rotation` in degrees turns the
  /// surroundings about the vertical: what was behind the camera moves to the right. Throws Error(invalid_input) at
  /// `place` for a picture that is not twice as wide as high, that has values that are not finite, or that is black.
  EnvironmentMap(std::span<const float> rgb, std::size_t width, std::size_t height, double rotation,
                 const std::string& place);

  ArrivingLight at(const Direction& w) const override;
  Direction sample(const std::array<double, 2>& u) const override;

 private:
  std::size_t pixel(const Direction& w) const;
  /// Solid angle of a pixel.
  double solid_angle(std::size_t line) const;

  std::size_t width_, height_;
  double rotation_;              // radians
  std::vector<float> radiance_;  // [line][column][channel]
  /// Sums of light up to each pixel of its line, and up to each line; the last is the whole.
  std::vector<double> pixel_sums_, line_sums_;
};

/// A picture file, any that OpenImageIO reads; 8-bit ones are sRGB. Throws Error(invalid_input), and as
/// EnvironmentMap does; Error(missing_part) if the picture module can't be opened.
EnvironmentMap read_environment(const std::filesystem::path& path, double rotation);

}  // namespace lobefit
