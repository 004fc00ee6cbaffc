#include "report/image_module.h"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace lobefit {

namespace {

/// The map is linear, PNG is sRGB.
float encode(float v) { return v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1.0f / 2.4f) - 0.055f; }
float decode(float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); }

bool write(OIIO::ImageBuf& picture, OIIO::TypeDesc type, const std::filesystem::path& path, std::string& failure) {
  // Its own format attributes would carry the date; a picture of the same values has the same bytes.
  picture.specmod().erase_attribute("DateTime");
  if (picture.has_error() || !picture.write(path.string(), type)) {
    failure = picture.geterror();
    return false;
  }
  return true;
}

}  // namespace

extern "C" {
WriteFalseColour lobefit_write_false_colour;
WritePicture lobefit_write_picture;
ReadPicture lobefit_read_picture;
}

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
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      std::array<float, 3> pixel{};
      if (covered.getchannel(x, y, 0, 0) != 0.0f) colours.getpixel(x, y, pixel.data());
      for (float& channel : pixel) channel = encode(channel);
      colours.setpixel(x, y, pixel.data());
    }
  }
  return write(colours, OIIO::TypeDesc::UINT8, path, failure);
}

bool lobefit_write_picture(std::span<const float> rgba, std::size_t size, bool display,
                           const std::filesystem::path& path, std::string& failure) {
  std::vector<float> values(rgba.begin(), rgba.end());
  if (display) {
    for (std::size_t k = 0; k < values.size(); ++k) {
      // PNG's alpha is not multiplied in; colours are those of the sphere also at its edge.
      if (k % 4 == 3) continue;
      const float alpha = values[k / 4 * 4 + 3];
      values[k] = alpha > 0.0f ? encode(std::clamp(values[k] / alpha, 0.0f, 1.0f)) : 0.0f;
    }
  }
  const auto pixels = static_cast<int>(size);
  OIIO::ImageSpec spec(pixels, pixels, 4, OIIO::TypeDesc::FLOAT);
  if (display) spec.attribute("oiio:UnassociatedAlpha", 1);
  OIIO::ImageBuf picture(spec, values.data());
  return write(picture, display ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT, path, failure);
}

bool lobefit_read_picture(const std::filesystem::path& path, std::vector<float>& rgb, std::size_t& width,
                          std::size_t& height, std::string& failure) {
  OIIO::ImageBuf picture(path.string());
  if (!picture.read(0, 0, /*force=*/true, OIIO::TypeDesc::FLOAT)) {
    failure = picture.geterror();
    return false;
  }
  const OIIO::ImageSpec& spec = picture.spec();
  width = static_cast<std::size_t>(spec.width);
  height = static_cast<std::size_t>(spec.height);
  const auto channels = static_cast<std::size_t>(spec.nchannels);
  std::vector<float> values(width * height * channels);
  if (!picture.get_pixels(picture.roi(), OIIO::TypeDesc::FLOAT, values.data())) {
    failure = picture.geterror();
    return false;
  }
  const bool encoded =
      picture.nativespec().format == OIIO::TypeDesc::UINT8 || spec.get_string_attribute("oiio:ColorSpace") == "sRGB";
  rgb.resize(3 * width * height);
  for (std::size_t pixel = 0; pixel < width * height; ++pixel) {
    for (std::size_t c = 0; c < 3; ++c) {
      // One or two channels are grey.
      const float value = values[pixel * channels + (channels >= 3 ? c : 0)];
      rgb[3 * pixel + c] = encoded ? decode(value) : value;
    }
  }
  return true;
}

}  // namespace lobefit
