// Pictures through OpenImageIO. The library is large and slow to load, so its part of lobefit is a module of its own,
// opened when a picture is asked for.
#pragma once

#include <filesystem>
#include <span>

#include "report/sphere.h"

namespace lobefit {

/// A height × width picture in false colours (viridis from the least to the largest value, NaN black), each value a
/// square of pixels, as PNG. Throws Error(missing_part) if the module can't be opened, Error(failure) if writing fails.
void write_false_colour(std::span<const float> values, std::size_t width, std::size_t height,
                        const std::filesystem::path& path, bool overwrite);

/// Throws Error(usage) unless the extension is one of those that write_picture() writes.
void check_picture_extension(const std::filesystem::path& path);

/// RGBA, alpha the cover and colours multiplied by it: .exr as linear 32-bit floats, .png as 8-bit sRGB. Radiance times
/// 2^exposure; what then exceeds 1 is white in a PNG. Errors as above; Error(usage) for another extension.
void write_picture(const SphereImage& image, double exposure, const std::filesystem::path& path, bool overwrite);

struct LinearPicture {
  std::size_t width = 0, height = 0;
  std::vector<float> rgb;  // [line][column][channel], linear
};
/// Any format of OpenImageIO's; 8-bit ones are sRGB. Throws Error(invalid_input) for what can't be read,
/// Error(missing_part) as above.
LinearPicture read_picture(const std::filesystem::path& path);

}  // namespace lobefit
