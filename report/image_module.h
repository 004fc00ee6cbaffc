// The seam between lobefit and its picture module.
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace lobefit {

inline constexpr const char* image_module_name = "liblobefit_image.so";
inline constexpr const char* write_false_colour_symbol = "lobefit_write_false_colour";

/// False with `failure` filled in if the picture could not be written.
using WriteFalseColour = bool(std::span<const float> values, std::size_t width, std::size_t height,
                              const std::filesystem::path& path, std::string& failure);

}  // namespace lobefit
