#include "reference/formats/brdf_file.h"

#include <algorithm>
#include <fstream>
#include <system_error>

#include "models/error.h"
#include "reference/formats/alta.h"
#include "reference/formats/byte_reader.h"
#include "reference/formats/klems.h"
#include "reference/formats/merl.h"
#include "reference/formats/neural_brdf.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

constexpr std::string_view exr_magic = "\x76\x2f\x31\x01";
constexpr std::string_view readable =
    "lobefit reads its own tables and lat-long pictures (.exr), MERL .binary, RGL .bsdf, UTIA .bin, ALTA text, "
    "LBNL/Klems XML and NBRDF weights";

/// A format that starts like a text of keywords, with one of these near its top.
bool has_any(std::string_view text, std::initializer_list<std::string_view> keywords) {
  const std::string_view head = text.substr(0, 4096);
  return std::any_of(keywords.begin(), keywords.end(),
                     [&](std::string_view keyword) { return head.find(keyword) != std::string_view::npos; });
}

std::int32_t first_integer(std::string_view bytes) {
  std::int32_t value = 0;
  if (bytes.size() >= sizeof(value)) std::memcpy(&value, bytes.data(), sizeof(value));
  return value;
}

void refuse_held(const ReadOptions& options) {
  if (!options.held) return;
  throw Error(ExitCode::usage, "the file holds the directions of all its values", "--wo, --wi",
              "leave them out: they are for lat-long pictures");
}

}  // namespace

BrdfFile read_brdf_file(const std::filesystem::path& path, const ReadOptions& options) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    throw Error(ExitCode::invalid_input, "no such file", path.string(), "check the path");
  }
  const std::string place = path.string();
  {
    std::array<char, 4> magic{};
    std::ifstream(path, std::ios::binary).read(magic.data(), magic.size());
    if (std::string_view(magic.data(), magic.size()) == exr_magic) {
      if (LatLong::recognise(path)) {
        return {.format = FileFormat::lat_long, .table = LatLong::read(path, options.held)};
      }
      refuse_held(options);
      return {.format = FileFormat::exr, .table = Table::read(path)};
    }
  }
  refuse_held(options);
  const std::string bytes = read_file(path);
  if (bytes.empty()) throw Error(ExitCode::invalid_input, "the file is empty", place, std::string(readable));
  if (bytes.starts_with("tensor_file")) {
    const auto rgl = std::make_shared<RglMaterial>(TensorFile::parse(bytes, place), place);
    return {.format = FileFormat::rgl, .table = rgl->table(), .rgl = rgl};
  }
  if (NeuralBrdf::recognise(bytes)) {
    const NeuralBrdf network = NeuralBrdf::parse(bytes, options.material, place);
    Table table = network.merl().table();
    table.parameters["format"] = "neural_brdf";
    table.parameters["material"] = network.name();
    return {.format = FileFormat::neural_brdf, .table = std::move(table)};
  }
  if (!options.material.empty()) {
    throw Error(ExitCode::usage, "the file holds one material only", "--material", "leave it out");
  }
  if (Klems::recognise(bytes)) return {.format = FileFormat::klems, .table = Klems::parse(bytes, place)};
  if (Alta::recognise(bytes)) return {.format = FileFormat::alta, .table = Alta::parse(bytes, place)};
  if (bytes.size() == Utia::file_size) {
    return {.format = FileFormat::utia, .table = Utia::parse(bytes, options.utia_scale, place)};
  }
  // Last, since its three numbers are no real mark. A wrong size is told by the reader.
  if (first_integer(bytes) == static_cast<std::int32_t>(Merl::theta_h_bins)) {
    return {.format = FileFormat::merl, .table = Merl::parse(bytes, place).table()};
  }
  const auto unreadable = [&](const char* what) {
    return Error(ExitCode::invalid_input, what, place + ", byte 0", std::string(readable));
  };
  if (has_any(bytes, {"Symmetry", "SpectralContent", "ScatterType", "SampleRotation"})) {
    throw unreadable("a Zemax or LightTools BSDF text, which lobefit does not read");
  }
  if (has_any(bytes, {"ASTM", "TITL", "VARS"})) throw unreadable("an ASTM E1392 text, which lobefit does not read");
  throw unreadable("no known format of BRDF data");
}

Table read_table(const std::filesystem::path& path) { return read_brdf_file(path).table; }

Table BrdfFile::resampled(const Grid& grid, bool nearest_bin) const {
  Table result;
  result.grid = grid;
  result.parameter_axes = table.parameter_axes;
  result.channels = table.channels;
  result.model = table.model;
  result.parameters = table.parameters;
  result.method = table.method;
  result.version = LOBEFIT_VERSION;
  result.allocate();
  const bool by_bin = nearest_bin && Merl::has_grid(table);
  for (std::size_t entry = 0; entry < result.entries(); ++entry) {
    if (by_bin) {
      const std::size_t bin = Merl::bin_of(result.wi(entry), result.wo(entry));
      result.valid[entry] = table.valid[bin];
      for (int c = 0; c < result.channels; ++c)
        result.values[static_cast<std::size_t>(c) * result.entries() + entry] = table.value(bin, c);
      continue;
    }
    try {
      const Rgb f = evaluate(result.wi(entry), result.wo(entry), result.parameter_row(entry));
      const std::array<double, 3> components{f.x, f.y, f.z};
      for (std::size_t c = 0; c < static_cast<std::size_t>(result.channels); ++c) {
        result.values[c * result.entries() + entry] = to_float(components[c]);
      }
    } catch (const Error&) {
      result.valid[entry] = 0;  // the file has no value there
    }
  }
  result.mask_what_is_not_finite(0, result.entries());
  return result;
}

RowBrdf row_brdf(const BrdfFile& file) {
  if (!file.rgl && file.table.coordinates == Coordinates::list) return nullptr;
  return [&file](std::size_t row, const Direction& wi, const Direction& wo) -> std::optional<Rgb> {
    try {
      return file.evaluate(wi, wo, row);
    } catch (const Error&) {
      return std::nullopt;
    }
  };
}

FileFormat format_of_extension(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".exr") return FileFormat::exr;
  if (extension == ".binary") return FileFormat::merl;
  if (extension == ".bsdf") return FileFormat::rgl;
  if (extension == ".alta" || extension == ".dat" || extension == ".txt") return FileFormat::alta;
  if (extension == ".csv") return FileFormat::csv;
  throw Error(ExitCode::usage, "no format has the extension '" + extension + "'", path.string(),
              "use .exr, .binary (MERL), .bsdf (RGL), .alta or .csv, or name it with --format");
}

FileFormat parse_output_format(std::string_view name) {
  for (const FileFormat format :
       {FileFormat::exr, FileFormat::merl, FileFormat::rgl, FileFormat::alta, FileFormat::csv}) {
    if (file_format_names[static_cast<std::size_t>(format)] == name) return format;
  }
  throw Error(ExitCode::usage, "unknown format '" + std::string(name) + "'", "--format",
              "choose exr, merl, rgl, alta or csv");
}

void write_brdf_file(const BrdfFile& file, FileFormat format, const std::filesystem::path& path) {
  const auto write = [&](const std::string& content) {
    std::ofstream stream(path, std::ios::binary);
    stream << content;
    stream.close();
    if (!stream) throw Error(ExitCode::failure, "write failed", path.string(), "check the free space on the disk");
  };
  switch (format) {
    case FileFormat::exr: file.table.write(path); return;
    case FileFormat::alta: write(Alta::text(file.table)); return;
    case FileFormat::csv: write(table_csv(file.table)); return;
    case FileFormat::rgl:
      if (!file.rgl) {
        throw Error(ExitCode::usage, "RGL files are written from RGL files alone", path.string(),
                    "their grid follows the material; choose .exr, .binary, .alta or .csv");
      }
      write(file.rgl->tensors().serialise());
      return;
    case FileFormat::merl: {
      if (file.table.parameter_rows() > 1) {
        throw Error(ExitCode::usage, "the table has parameter axes, a MERL table has none", path.string(),
                    "choose a row with --set");
      }
      const auto isotropic = file.table.parameters.find("isotropic");
      if (isotropic != file.table.parameters.end() && *isotropic == false) {
        throw Error(ExitCode::usage, "the material is anisotropic, a MERL table is not", path.string(),
                    "choose .exr, .alta or .csv");
      }
      const Merl merl =
          Merl::has_grid(file.table)
              ? Merl::of_table(file.table)
              : Merl::of_brdf([&](const Direction& wi, const Direction& wo) { return file.evaluate(wi, wo); });
      write(merl.serialise());
      return;
    }
    case FileFormat::utia:
    case FileFormat::klems:
    case FileFormat::lat_long:
    case FileFormat::neural_brdf: break;
  }
  throw Error(ExitCode::usage, "this format is only read", path.string(), "choose exr, merl, rgl, alta or csv");
}

}  // namespace lobefit
