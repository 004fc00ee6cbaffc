// Any file of BRDF values, known by its bytes.
//
//   const BrdfFile file = read_brdf_file("aurora_white_rgb.bsdf");
//   file.table                      on the file's own grid: fits, comparisons and figures take it like any table
//   file.evaluate(wi, wo)           at any pair of directions
//   write_brdf_file(file, FileFormat::merl, "aurora_white.binary")
//
// The extension says nothing on the way in: `.bsdf` names three formats.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "reference/brdf_pair.h"
#include "reference/formats/lat_long.h"
#include "reference/formats/rgl.h"
#include "reference/formats/utia.h"
#include "reference/table.h"

namespace lobefit {

enum class FileFormat { exr, merl, rgl, utia, alta, klems, neural_brdf, csv, lat_long };
inline constexpr std::array<std::string_view, 9> file_format_names{"exr",   "merl",        "rgl", "utia",    "alta",
                                                                   "klems", "neural_brdf", "csv", "lat_long"};

struct ReadOptions {
  std::string material;  // of files that hold several
  Utia::Scale utia_scale = Utia::Scale::raw;
  std::optional<LatLong::Held> held = std::nullopt;  // of lat-long pictures that do not say it
};

struct BrdfFile {
  FileFormat format = FileFormat::exr;
  Table table;
  std::shared_ptr<const RglMaterial> rgl = nullptr;  // evaluates in its own coordinates

  /// BRDF at any pair of directions, of one parameter row. Throws Error(usage) where the file has no value.
  Rgb evaluate(const Direction& wi, const Direction& wo, std::size_t row = 0) const {
    return rgl ? rgl->evaluate(wi, wo) : table.interpolate(row, wi, wo);
  }
  /// On a grid of angles; masked where the file has no value. `nearest_bin`: MERL tables give the bin that a pair falls
  /// into, as published scores take them, in the place of an interpolation.
  Table resampled(const Grid& grid, bool nearest_bin = false) const;
  /// One parameter row alone.
  BrdfFile row_slice(std::size_t row) const { return {format, table.row_slice(row), rgl}; }
};

/// A file at any pair of directions, to which it refers; null where it knows its own entries alone.
RowBrdf row_brdf(const BrdfFile& file);

/// Throws Error(invalid_input) with the byte or line that is wrong, Error(usage) for a material that the file lacks.
BrdfFile read_brdf_file(const std::filesystem::path& path, const ReadOptions& options = {});
/// The table alone.
Table read_table(const std::filesystem::path& path);

/// By the extension of a path: .exr, .binary (MERL), .bsdf (RGL), .alta, .dat or .txt (ALTA), .csv. Throws
/// Error(usage).
FileFormat format_of_extension(const std::filesystem::path& path);
/// A name that can be written: exr, merl, rgl, alta, csv. Throws Error(usage).
FileFormat parse_output_format(std::string_view name);

/// Writes to `path` as it is (see OutputFile); throws Error(usage) for what a format cannot hold: RGL files are written
/// from RGL files alone, byte for byte; MERL tables from isotropic materials.
void write_brdf_file(const BrdfFile& file, FileFormat format, const std::filesystem::path& path);

}  // namespace lobefit
