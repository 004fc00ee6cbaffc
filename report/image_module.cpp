#include "report/image_module.h"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace lobefit {

extern "C" bool lobefit_write_false_colour(std::span<const float> values, std::size_t width, std::size_t height,
                                           const std::filesystem::path& path, std::string& failure);

bool lobefit_write_false_colour(std::span<const float> values, std::size_t width, std::size_t height,
                                const std::filesystem::path& path, std::string& failure) {
  float low = std::numeric_limits<float>::infinity(), high = -low;
  for (const float v : values) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  const float range = high > low ? high - low : 1.0f;
  // Squares, so that a table of 18 × 18 is not a thumbnail.
  const std::size_t square = std::max<std::size_t>(1, 512 / std::max(width, height));
  const auto w = static_cast<int>(width * square), h = static_cast<int>(height * square);
  std::vector<float> grey(width * square * height * square), mask(grey.size());
  for (std::size_t i = 0; i < grey.size(); ++i) {
    const std::size_t x = i % (width * square) / square, y = i / (width * square) / square;
    const float v = values[y * width + x];
    mask[i] = std::isfinite(v) ? 1.0f : 0.0f;
    grey[i] = std::isfinite(v) ? (v - low) / range : 0.0f;
  }
  const OIIO::ImageSpec spec(w, h, 1, OIIO::TypeDesc::FLOAT);
  const OIIO::ImageBuf plane(spec, grey.data()), covered(spec, mask.data());
  OIIO::ImageBuf colours = OIIO::ImageBufAlgo::color_map(plane, 0, "viridis");
  // The map is linear, PNG is sRGB.
  const auto encode = [](float v) { return v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1.0f / 2.4f) - 0.055f; };
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      std::array<float, 3> pixel{};
      if (covered.getchannel(x, y, 0, 0) != 0.0f) colours.getpixel(x, y, pixel.data());
      for (float& channel : pixel) channel = encode(channel);
      colours.setpixel(x, y, pixel.data());
    }
  }
  // Its own format attributes would carry the date; a picture of the same table has the same bytes.
  colours.specmod().erase_attribute("DateTime");
  if (colours.has_error() || !colours.write(path.string(), OIIO::TypeDesc::UINT8)) {
    failure = colours.geterror();
    return false;
  }
  return true;
}

}  // namespace lobefit
