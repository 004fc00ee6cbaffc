// Lat-long pictures, `.exr`: a BRDF over one direction while the other stays where it is, as an equirectangular map.
//
// +z, the normal, is up. A picture twice as wide as high shows the whole sphere, one four times as wide the hemisphere
// above the surface. Pixels are areas: with W columns, the centre of column x and line y has the azimuth (x + ½) 360°/W
// and the polar angle (y + ½) 360°/W, so that lines go down from the normal. Values are BRDFs in 1/sr without cosine,
// linear Rec.709 in R, G, B or one channel Y, 16- or 32-bit; what is negative, not finite or has A = 0 is masked.
// Nothing below the horizon is read: light that passes is no BRDF.
//
// The other direction stands in the file's attributes, numbers or texts in degrees: theta_o and phi_o where the view
// is held and the picture shows the light's directions, theta_i and phi_i where the light is held; azimuths that are
// left out are 0. Azimuths are counted from it, so the axes of an anisotropic surface turn with it: hold it at azimuth
// 0 where they matter.
#pragma once

#include <filesystem>
#include <optional>

#include "reference/albedo.h"
#include "reference/table.h"

namespace lobefit {

struct LatLong {
  /// The direction that a picture holds, in degrees.
  struct Held {
    FixedDirection which;
    double theta, phi;
  };

  /// Whether an EXR file carries none of the attributes of lobefit's own tables. Throws Error(invalid_input) where it
  /// cannot be read.
  static bool recognise(const std::filesystem::path& path);
  /// A table of one theta_o (or theta_i) and the picture's own midpoints. `held` is for files that do not say it.
  /// Throws Error(invalid_input) for other pictures and broken files, and where the held direction is not known;
  /// Error(usage) where `held` says another one than the file.
  static Table read(const std::filesystem::path& path, const std::optional<Held>& held);
};

}  // namespace lobefit
