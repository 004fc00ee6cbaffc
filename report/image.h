// Pictures through OpenImageIO. The library is large and slow to load, so its part of lobefit is a module of its own,
// opened when a picture is asked for.
#pragma once

#include <filesystem>
#include <span>

namespace lobefit {

/// A height × width picture in false colours (viridis from the least to the largest value, NaN black), each value a
/// square of pixels, as PNG. Throws Error(missing_part) if the module can't be opened, Error(failure) if writing fails.
void write_false_colour(std::span<const float> values, std::size_t width, std::size_t height,
                        const std::filesystem::path& path, bool overwrite);

}  // namespace lobefit
