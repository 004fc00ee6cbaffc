// The seam between lobefit and its picture module.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace lobefit {

inline constexpr const char* image_module_name = "liblobefit_image.so";
inline constexpr const char* write_false_colour_symbol = "lobefit_write_false_colour";
inline constexpr const char* write_picture_symbol = "lobefit_write_picture";
inline constexpr const char* read_picture_symbol = "lobefit_read_picture";

/// False with `failure` filled in if the picture could not be written.
using WriteFalseColour = bool(std::span<const float> values, std::size_t width, std::size_t height,
                              const std::filesystem::path& path, std::string& failure);
/// Linear RGBA, size × size; `display` encodes as 8-bit sRGB.
using WritePicture = bool(std::span<const float> rgba, std::size_t size, bool display,
                          const std::filesystem::path& path, std::string& failure);
/// Linear RGB, [line][column][channel]; what the file says to be sRGB, or is of 8 bits, is decoded.
using ReadPicture = bool(const std::filesystem::path& path, std::vector<float>& rgb, std::size_t& width,
                         std::size_t& height, std::string& failure);

}  // namespace lobefit
