#include "reference/formats/lat_long.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>

#include <array>
#include <cmath>
#include <string_view>

#include "models/error.h"
#include "reference/formats/byte_reader.h"

namespace lobefit {

namespace {

Error invalid(const std::filesystem::path& path, const std::string& what,
              const std::string& mend = "give a table of lobefit, or a picture of a BRDF over directions, 2:1 or 4:1") {
  return {ExitCode::invalid_input, what, path.string(), mend};
}

/// What OpenEXR throws becomes Error(invalid_input).
template <class Act>
auto reading(const std::filesystem::path& path, Act&& act) {
  try {
    return act();
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw invalid(path, std::string("not a readable EXR file: ") + error.what(), "fetch or write the file again");
  }
}

/// An angle in degrees, or none.
std::optional<double> angle(const Imf::Header& header, const char* name, const std::filesystem::path& path) {
  if (header.find(name) == header.end()) return {};
  std::optional<double> value;
  if (const auto* a = header.findTypedAttribute<Imf::FloatAttribute>(name)) value = a->value();
  if (const auto* a = header.findTypedAttribute<Imf::DoubleAttribute>(name)) value = a->value();
  if (const auto* a = header.findTypedAttribute<Imf::IntAttribute>(name)) value = a->value();
  if (const auto* a = header.findTypedAttribute<Imf::StringAttribute>(name)) value = parse_double(a->value());
  if (!value || !std::isfinite(*value)) {
    throw invalid(path, std::string("attribute ") + name + " is no number", "write it in degrees");
  }
  return value;
}

std::optional<LatLong::Held> stated(const Imf::Header& header, const std::filesystem::path& path) {
  const auto theta_o = angle(header, "theta_o", path), theta_i = angle(header, "theta_i", path);
  if (!theta_o && !theta_i) return {};
  if (theta_o && theta_i) {
    throw invalid(path, "attributes theta_o and theta_i both hold a direction",
                  "name the one that is the same in all pixels");
  }
  const double phi = angle(header, theta_o ? "phi_o" : "phi_i", path).value_or(0.0);
  return LatLong::Held{theta_o ? FixedDirection::view : FixedDirection::light, theta_o.value_or(theta_i.value_or(0.0)),
                       phi};
}

LatLong::Held held_direction(const std::optional<LatLong::Held>& told, const std::optional<LatLong::Held>& given,
                             const std::filesystem::path& path) {
  if (!told && !given) {
    throw invalid(path, "the picture does not say which direction it holds",
                  "give --wo or --wi THETA,PHI to `lobefit table convert`, or write the attributes theta_o, phi_o");
  }
  if (told && given && (told->which != given->which || told->theta != given->theta || told->phi != given->phi)) {
    throw Error(ExitCode::usage, "the picture itself holds another direction", path.string(),
                "leave --wo and --wi out, or correct its attributes");
  }
  const LatLong::Held held = told ? *told : *given;
  if (!(held.theta >= 0.0 && held.theta < 90.0)) {
    throw invalid(path, "the direction held lies " + number_text(held.theta) + " degrees from the normal",
                  "give an angle from 0 to below 90 degrees");
  }
  return held;
}

/// Lines from the normal to the horizon.
int lines_above(int width, int height, const std::filesystem::path& path) {
  constexpr int most_columns = 8192;  // 3 GB of table
  if (width < 4 || (width != 2 * height && width != 4 * height)) {
    throw invalid(path, "a picture of " + std::to_string(width) + " × " + std::to_string(height) +
                            " pixels: neither a lobefit table nor a lat-long picture");
  }
  if (width > most_columns) {
    throw invalid(path, std::to_string(width) + " columns are more than " + std::to_string(most_columns),
                  "scale the picture down");
  }
  return width / 4;  // the line that the horizon halves belongs to neither side
}

/// Channels to read, in the order of a table.
std::vector<const char*> channel_names(const Imf::ChannelList& channels, const std::filesystem::path& path) {
  std::vector<const char*> names{"Y"};
  if (channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B")) names = {"R", "G", "B"};
  if (!channels.findChannel(names.front())) {
    std::string there;
    for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
      there += (there.empty() ? "" : ", ") + std::string(channel.name());
    }
    throw invalid(path, "no channels R, G, B or Y, but " + there, "name them so");
  }
  if (channels.findChannel("A")) names.push_back("A");
  for (const char* name : names) {
    const Imf::Channel& channel = channels[name];
    if (channel.type == Imf::UINT || channel.xSampling != 1 || channel.ySampling != 1) {
      throw invalid(path, std::string("channel ") + name + " holds integers or is subsampled",
                    "write it as 16- or 32-bit floats at full resolution");
    }
  }
  return names;
}

}  // namespace

bool LatLong::recognise(const std::filesystem::path& path) {
  return reading(path, [&] {
    const Imf::InputFile file(path.c_str());
    for (auto attribute = file.header().begin(); attribute != file.header().end(); ++attribute) {
      if (std::string_view(attribute.name()).starts_with("lobefit:")) return false;
    }
    return true;
  });
}

Table LatLong::read(const std::filesystem::path& path, const std::optional<Held>& held_elsewhere) {
  return reading(path, [&] {
    const int parts = Imf::MultiPartInputFile(path.c_str()).parts();
    if (parts != 1) throw invalid(path, "the file has " + std::to_string(parts) + " parts", "write a file for each");
    Imf::InputFile file(path.c_str());
    const Imf::Header& header = file.header();
    if (Imf::hasEnvmap(header)) {
      throw invalid(path, "attribute envmap: OpenEXR's environment maps have other axes, and pixels on the poles",
                    "map it to pixel centres with +z up and azimuths growing to the right, and drop the attribute");
    }
    const auto window = header.dataWindow();
    const auto extent = [](int low, int high) {
      return static_cast<int>(std::min<std::int64_t>(std::int64_t{high} - low + 1, std::numeric_limits<int>::max()));
    };
    const int columns = extent(window.min.x, window.max.x);
    const int lines = lines_above(columns, extent(window.min.y, window.max.y), path);
    const std::vector<const char*> names = channel_names(header.channels(), path);
    const Held held = held_direction(stated(header, path), held_elsewhere, path);

    const auto width = static_cast<std::size_t>(columns), height = static_cast<std::size_t>(lines);
    std::vector<float> pixels(names.size() * width * height);
    Imf::FrameBuffer frame;
    for (std::size_t c = 0; c < names.size(); ++c) {
      frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, pixels.data() + c * width * height,
                                              Imath::V2i(window.min.x, window.min.y), columns, lines));
    }
    file.setFrameBuffer(frame);
    file.readPixels(window.min.y, window.min.y + lines - 1);

    const bool view_held = held.which == FixedDirection::view;
    const double step = 360.0 / columns;
    Table table;
    Axis polar{view_held ? "theta_i" : "theta_o", "degree", {}, true};
    for (int y = 0; y < lines; ++y) polar.values.push_back((y + 0.5) * step);
    const Axis still{view_held ? "theta_o" : "theta_i", "degree", {held.theta}, false};
    // A table's azimuths are the light's seen from the view, and grow from 0: which column comes first?
    std::vector<std::pair<double, std::size_t>> azimuths;
    for (int x = 0; x < columns; ++x) {
      const double ahead = (x + 0.5) * step - held.phi;
      double azimuth = std::fmod(view_held ? ahead : -ahead, 360.0);
      if (azimuth < 0.0) azimuth += 360.0;
      if (azimuth >= 360.0) azimuth = 0.0;
      azimuths.emplace_back(azimuth, static_cast<std::size_t>(x));
    }
    std::sort(azimuths.begin(), azimuths.end());
    Axis phi{"phi", "degree", {}, true};
    for (const auto& [azimuth, column] : azimuths) phi.values.push_back(azimuth);
    table.grid = view_held ? Grid{polar, still, phi} : Grid{still, polar, phi};
    table.channels = names[0] == std::string_view("Y") ? 1 : 3;
    table.allocate();
    const auto channels = static_cast<std::size_t>(table.channels);
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      const std::size_t line = view_held ? table.theta_i_index(entry) : table.theta_o_index(entry);
      const std::size_t pixel = line * width + azimuths[table.phi_index(entry)].second;
      for (std::size_t c = 0; c < names.size(); ++c) {
        const float value = pixels[c * width * height + pixel];
        if (c == channels ? value == 0.0f : !(value >= 0.0f)) table.valid[entry] = 0;
        if (c < channels) table.values[c * table.entries() + entry] = value;
      }
    }
    table.mask_what_is_not_finite(0, table.entries());
    table.model = "measured";
    table.parameters = {{"format", "lat_long"}};
    table.method = "measured";
    return table;
  });
}

}  // namespace lobefit
