#include "reference/formats/klems.h"

#include <pugixml.hpp>
#include <vector>

#include "reference/formats/byte_reader.h"

namespace lobefit {

namespace {

struct Patch {
  double theta, phi, solid_angle;
};

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r\n") - begin + 1);
}

}  // namespace

bool Klems::recognise(std::string_view text) {
  return text.substr(0, 65536).find("<WindowElement") != std::string_view::npos;
}

Table Klems::parse(std::string_view text, const std::string& place) {
  pugi::xml_document document;
  const auto error = [&](const std::string& what, std::ptrdiff_t byte) {
    return Error(ExitCode::invalid_input, what, place + ", byte " + std::to_string(byte),
                 "give an LBNL/Klems BSDF file with a front reflection");
  };
  const pugi::xml_parse_result parsed = document.load_buffer(text.data(), text.size());
  if (!parsed) throw error("not valid XML: " + std::string(parsed.description()), parsed.offset);
  const auto number = [&](const pugi::xml_node& node) {
    const auto value = parse_double(trimmed(node.child_value()));
    if (!value || !std::isfinite(*value)) {
      throw error("<" + std::string(node.name()) + "> is missing or no number", node ? node.offset_debug() : 0);
    }
    return *value;
  };
  const pugi::xml_node layer = document.child("WindowElement").child("Optical").child("Layer");
  if (!layer) throw error("no WindowElement/Optical/Layer", 0);

  const auto is_visible = [](const pugi::xml_node& data) {
    return trimmed(data.child_value("Wavelength")) == "Visible";
  };
  pugi::xml_node block;
  bool visible = false;
  for (const pugi::xml_node& data : layer.children("WavelengthData")) {
    for (const pugi::xml_node& candidate : data.children("WavelengthDataBlock")) {
      if (trimmed(candidate.child_value("WavelengthDataDirection")) != "Reflection Front") continue;
      if (!block || (is_visible(data) && !visible)) {
        block = candidate;
        visible = is_visible(data);
      }
    }
  }
  if (!block) throw error("no block with the direction 'Reflection Front'", layer.offset_debug());

  const pugi::xml_node scattering = block.child("ScatteringData");
  std::vector<double> matrix;
  std::string_view rest = scattering.child_value();
  for (std::string_view word = next_word(rest, ", \t\r\n"); !word.empty(); word = next_word(rest, ", \t\r\n")) {
    const auto value = parse_double(word);
    if (!value || !std::isfinite(*value)) {
      throw error("number " + std::to_string(matrix.size() + 1) + " of the matrix is none", scattering.offset_debug());
    }
    matrix.push_back(*value);
  }

  const pugi::xml_node definition = layer.child("DataDefinition");
  const auto patches = [&](const char* which) {
    const std::string_view name = trimmed(block.child_value(which));
    for (const pugi::xml_node& basis : definition.children("AngleBasis")) {
      if (trimmed(basis.child_value("AngleBasisName")) != name) continue;
      std::vector<Patch> result;
      for (const pugi::xml_node& ring : basis.children("AngleBasisBlock")) {
        const double count = number(ring.child("nPhis"));
        const double lower = number(ring.child("ThetaBounds").child("LowerTheta"));
        const double upper = number(ring.child("ThetaBounds").child("UpperTheta"));
        // The centre of the pole's single patch is the pole, whatever the file calls its middle.
        const double theta = lower == 0.0 && count == 1.0 ? 0.0 : number(ring.child("Theta"));
        if (!(count >= 1.0 && count == std::floor(count)) || !(lower >= 0.0 && lower < upper && upper <= 90.0) ||
            !(theta >= lower && theta <= upper)) {
          throw error("a ring's angles or nPhis are out of range", ring.offset_debug());
        }
        if (count + static_cast<double>(result.size()) > static_cast<double>(matrix.size())) {
          throw error("the basis has more patches than the matrix numbers", ring.offset_debug());
        }
        const double solid_angle = 2.0 * pi * (std::cos(radians(lower)) - std::cos(radians(upper))) / count;
        for (int k = 0; k < static_cast<int>(count); ++k) {
          result.push_back({radians(theta), 2.0 * pi * k / count, solid_angle});
        }
      }
      if (!result.empty()) return result;
    }
    throw error("no angle basis '" + std::string(name) + "'", block.offset_debug());
  };
  std::vector<Patch> column = patches("ColumnAngleBasis"), row = patches("RowAngleBasis");
  const bool columns_incident = trimmed(definition.child_value("IncidentDataStructure")) != "Rows";
  const std::vector<Patch>& incident = columns_incident ? column : row;
  const std::vector<Patch>& outgoing = columns_incident ? row : column;
  if (matrix.size() / column.size() != row.size() || matrix.size() % column.size() != 0) {
    throw error("the matrix has " + std::to_string(matrix.size()) + " numbers instead of " +
                    std::to_string(row.size()) + " × " + std::to_string(column.size()),
                scattering.offset_debug());
  }

  Table table;
  table.coordinates = Coordinates::list;
  table.grid = {.theta_i = {"block", "", {0.0}, false},
                .theta_o = {"incident_patch", "", {}, false},
                .phi = {"outgoing_patch", "", {}, false}};
  for (std::size_t k = 0; k < incident.size(); ++k) table.grid.theta_o.values.push_back(static_cast<double>(k));
  for (std::size_t k = 0; k < outgoing.size(); ++k) table.grid.phi.values.push_back(static_cast<double>(k));
  table.channels = 1;
  table.allocate();
  for (std::size_t i = 0; i < incident.size(); ++i) {
    // Equal patch numbers are what goes straight through, and mirror directions in reflection: the incident hemisphere
    // is turned by half a circle.
    const Direction wi = direction(incident[i].theta, incident[i].phi + pi);
    for (std::size_t o = 0; o < outgoing.size(); ++o) {
      const Direction wo = direction(outgoing[o].theta, outgoing[o].phi);
      const std::size_t entry = i * outgoing.size() + o;
      const double value = columns_incident ? matrix[o * incident.size() + i] : matrix[i * outgoing.size() + o];
      table.set_directions(entry, wi, wo);
      table.measure[entry] = static_cast<float>(incident[i].solid_angle * outgoing[o].solid_angle);
      table.values[entry] = to_float(value);
      if (value < 0.0) table.valid[entry] = 0;
    }
  }
  table.model = "measured";
  table.parameters = {{"format", "klems"}, {"isotropic", false}};
  table.method = "measured";
  table.mask_what_is_not_finite(0, table.entries());
  return table;
}

}  // namespace lobefit
