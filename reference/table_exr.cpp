// Tables as OpenEXR files: one part, readable as a picture.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include "models/error.h"
#include "reference/json_reader.h"
#include "reference/table.h"

namespace lobefit {

namespace {

Imf::Slice slice(float* data, std::size_t width) {
  return {Imf::FLOAT, reinterpret_cast<char*>(data), sizeof(float), sizeof(float) * width};
}

Error invalid(const std::filesystem::path& path, const std::string& what) {
  return {ExitCode::invalid_input, what, path.string(),
          "give a table that `lobefit render` wrote; `lobefit table info FILE` tells whether a file is one"};
}

}  // namespace

void Table::write(const std::filesystem::path& path) const {
  try {
    Imf::Header header(static_cast<int>(width()), static_cast<int>(height()));
    header.compression() = Imf::ZIP_COMPRESSION;
    const Json description = describe();
    const auto attribute = [&](const char* name, const std::string& text) {
      header.insert(std::string("lobefit:") + name, Imf::StringAttribute(text));
    };
    attribute("coordinates", description["coordinates"]);
    attribute("axes", description["axes"].dump());
    attribute("quantity", description["quantity"]);
    attribute("reference", model);
    attribute("params", parameters.dump());
    attribute("method", method);
    attribute("seed", std::to_string(seed));
    attribute("samples", std::to_string(samples));
    attribute("shared_facets", shared_facets ? "true" : "false");
    if (!sampler.empty()) attribute("sampler", sampler);
    if (stderr_target > 0.0) attribute("stderr_target", number_text(stderr_target));
    if (shards.count > 1) attribute("shard", shards.text());
    attribute("version", version);
    attribute("command", command);

    Table copy = *this;
    std::vector<float> mask(valid.begin(), valid.end());
    std::vector<Plane> all = copy.planes();
    all.push_back({"A", mask.data()});
    Imf::FrameBuffer frame;
    for (const Plane& plane : all) {
      header.channels().insert(plane.name, Imf::Channel(Imf::FLOAT));
      frame.insert(plane.name, slice(plane.data, width()));
    }
    std::ofstream stream(path, std::ios::binary);
    if (!stream) throw std::runtime_error(std::strerror(errno));
    {
      Imf::StdOFStream exr_stream(stream, path.c_str());
      Imf::OutputFile file(exr_stream, header);
      file.setFrameBuffer(frame);
      file.writePixels(static_cast<int>(height()));
    }
    // OpenEXR writes its last bytes in a destructor, which keeps failures to itself.
    stream.close();
    if (!stream) throw std::runtime_error("the last bytes could not be written");
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(ExitCode::failure, std::string("can't write the table: ") + error.what(), path.string(),
                "check the free space on the disk");
  }
}

Table Table::read(const std::filesystem::path& path) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    throw Error(ExitCode::invalid_input, "no such file", path.string(), "check the path");
  }
  try {
    Imf::InputFile file(path.c_str());
    const Imf::Header& header = file.header();
    const auto has = [&](const char* name) {
      return header.findTypedAttribute<Imf::StringAttribute>(std::string("lobefit:") + name) != nullptr;
    };
    const auto attribute = [&](const char* name) -> std::string {
      const auto* found = header.findTypedAttribute<Imf::StringAttribute>(std::string("lobefit:") + name);
      if (!found)
        throw invalid(path, std::string("an EXR picture, but not a lobefit table: no attribute lobefit:") + name);
      // Broken files put control characters here, which would cut or garble messages.
      std::string text = found->value();
      for (char& c : text) c = static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' && c != '\r' ? '?' : c;
      return text;
    };
    const auto number = [&](const char* name) {
      const std::string text = attribute(name);
      if (text.empty() || text.size() > 20 || text.find_first_not_of("0123456789") != std::string::npos) {
        throw invalid(path, std::string("attribute lobefit:") + name + " is not a whole number");
      }
      return std::stoull(text);
    };
    const std::string coordinates = attribute("coordinates");
    const auto known = std::find(coordinates_names.begin(), coordinates_names.end(), coordinates);
    if (known == coordinates_names.end()) throw invalid(path, "unknown coordinates '" + coordinates + "'");

    Table table;
    table.coordinates = static_cast<Coordinates>(known - coordinates_names.begin());
    const std::string axes_place = path.string() + ", lobefit:axes";
    const Json axes = parse_json(attribute("axes"), axes_place);
    for (const JsonReader& reader : JsonReader(axes, axes_place).elements()) {
      Axis axis{reader.at("name").text(), reader.at("unit").text(), reader.at("values").numbers(),
                reader.at("kind").text() == "midpoints"};
      if (!axis.midpoints && reader.at("kind").text() != "points") {
        throw reader.at("kind").error("unknown kind of axis", "write points or midpoints");
      }
      if (table.coordinates != Coordinates::spherical) {
        table.parameter_axes.push_back(axis);
        continue;
      }
      if (axis.name == "theta_i" || axis.name == "theta_o") check_angles(reader.at("values"), 180.0, true);
      if (axis.name == "phi") check_angles(reader.at("values"), 360.0, false);
      if (axis.name == "theta_i")
        table.grid.theta_i = axis;
      else if (axis.name == "theta_o")
        table.grid.theta_o = axis;
      else if (axis.name == "phi")
        table.grid.phi = axis;
      else
        table.parameter_axes.push_back(axis);
    }
    if (table.coordinates != Coordinates::spherical && table.parameter_axes.size() >= 3) {
      // The last three stand for the grid's own.
      table.grid.phi = table.parameter_axes.back();
      table.parameter_axes.pop_back();
      table.grid.theta_i = table.parameter_axes.back();
      table.parameter_axes.pop_back();
      table.grid.theta_o = table.parameter_axes.back();
      table.parameter_axes.pop_back();
    }
    if (table.coordinates == Coordinates::rusinkiewicz &&
        (table.grid.theta_o.name != "theta_h" || table.grid.theta_i.name != "theta_d" ||
         table.grid.phi.name != "phi_d")) {
      throw invalid(path, "lobefit:coordinates is rusinkiewicz, but the last axes are not theta_h, theta_d, phi_d");
    }
    if (table.grid.theta_i.size() * table.grid.theta_o.size() * table.grid.phi.size() == 0) {
      throw invalid(path, "lobefit:axes lacks theta_i, theta_o or phi");
    }
    // Held against the picture's size before anything is allocated.
    const auto window = header.dataWindow();
    const auto width = static_cast<std::uint64_t>(std::int64_t{window.max.x} - window.min.x + 1);
    const auto height = static_cast<std::uint64_t>(std::int64_t{window.max.y} - window.min.y + 1);
    if (width != table.width() || height != table.height() || window.min.x != 0 || window.min.y != 0) {
      throw invalid(path, "the picture is " + std::to_string(width) + " × " + std::to_string(height) +
                              ", its axes say " + std::to_string(table.width()) + " × " +
                              std::to_string(table.height()));
    }
    // Deflate packs at most 1032 : 1, so a file also bounds what may be allocated for it.
    double bytes = 0.0;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
      bytes += 4.0 * static_cast<double>(width) * static_cast<double>(height);
    }
    if (bytes > 1100.0 * static_cast<double>(std::filesystem::file_size(path))) {
      throw invalid(path, "truncated: the picture is " + std::to_string(width) + " × " + std::to_string(height) +
                              ", more than a file of its size can hold");
    }
    table.model = attribute("reference");
    table.parameters = parse_json(attribute("params"), path.string() + ", lobefit:params");
    if (!table.parameters.is_object()) throw invalid(path, "attribute lobefit:params is not an object");
    table.method = attribute("method");
    table.seed = number("seed");
    table.samples = number("samples");
    table.shared_facets = attribute("shared_facets") == "true";
    if (has("sampler")) table.sampler = attribute("sampler");
    try {
      if (has("stderr_target")) table.stderr_target = parse_number(attribute("stderr_target"), "lobefit:stderr_target");
      if (has("shard")) table.shards = Shards::parse(attribute("shard"), "lobefit:shard");
    } catch (const Error& error) {
      throw error.inside(ExitCode::invalid_input, path.string());
    }
    if (table.shards.count > table.height()) throw invalid(path, "attribute lobefit:shard has more shards than lines");
    table.version = attribute("version");
    table.command = attribute("command");

    table.channels = header.channels().findChannel("Y") ? 1 : 3;
    while (header.channels().findChannel("order." + std::to_string(table.orders + 1) + ".Y")) ++table.orders;
    table.allocate();
    if (header.channels().findChannel(std::string("replicate.0.") + (table.channels == 1 ? "Y" : "R"))) {
      table.replicates.assign(table.values.size() * replicate_count, 0.0f);
    }
    if (header.channels().findChannel("replicate.0.order.1.Y")) {
      table.order_replicates.assign(table.order_values.size() * replicate_count, 0.0f);
    }
    if (header.channels().findChannel("samples")) table.sample_counts.assign(table.entries(), 0.0f);
    std::vector<float> mask(table.entries());
    std::vector<Plane> all = table.planes();
    all.push_back({"A", mask.data()});
    Imf::FrameBuffer frame;
    for (const Plane& plane : all) {
      const Imf::Channel* channel = header.channels().findChannel(plane.name);
      if (!channel || channel->type != Imf::FLOAT) throw invalid(path, "no float channel '" + plane.name + "'");
      frame.insert(plane.name, slice(plane.data, table.width()));
    }
    file.setFrameBuffer(frame);
    file.readPixels(0, static_cast<int>(table.height()) - 1);
    for (std::size_t i = 0; i < mask.size(); ++i) table.valid[i] = mask[i] != 0.0f ? 1 : 0;
    table.mask_what_is_not_finite(0, table.entries());
    for (std::size_t k = 0; k < table.directions.size(); k += 3 * table.entries()) {
      for (std::size_t entry = 0; entry < table.entries(); ++entry) {
        const float* w = table.directions.data() + k + entry;
        const double length = std::hypot(w[0], w[table.entries()], w[2 * table.entries()]);
        if (!(std::abs(length - 1.0) < 1e-3)) table.valid[entry] = 0;  // no direction
      }
    }
    return table;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw invalid(path, std::string("not a readable EXR file: ") + error.what());
  }
}

}  // namespace lobefit
