#include "reference/formats/alta.h"

#include <algorithm>
#include <array>

#include "reference/formats/byte_reader.h"

namespace lobefit {

namespace {

struct Pair {
  Direction wi, wo;
};

struct Parametrisation {
  std::string_view name;
  std::size_t inputs;
  bool isotropic;
  Pair (*directions)(const double* x);
};

// In the order of the inputs: L the light, V the view.
constexpr std::array<Parametrisation, 5> parametrisations{{
    {"ISOTROPIC_TL_TV_PROJ_DPHI", 3, true,
     [](const double* x) {
       return Pair{direction(x[0], 0.0), direction(std::hypot(x[1], x[2]), std::atan2(x[2], x[1]))};
     }},
    {"ISOTROPIC_TV_TL_DPHI", 3, true,
     [](const double* x) {
       return Pair{direction(x[1], 0.0), direction(x[0], x[2])};
     }},
    {"RUSIN_TH_TD_PD", 3, true,
     [](const double* x) {
       const HalfDifference angles{x[0], x[1], x[2]};
       return Pair{angles.wi(), angles.wo()};
     }},
    {"SPHERICAL_TL_PL_TV_PV", 4, false,
     [](const double* x) {
       return Pair{direction(x[0], x[1]), direction(x[2], x[3])};
     }},
    {"CARTESIAN", 6, false,
     [](const double* x) {
       return Pair{{x[3], x[4], x[5]}, {x[0], x[1], x[2]}};
     }},
}};

double polar(const Direction& w) { return std::atan2(std::hypot(w.x, w.y), w.z); }

}  // namespace

bool Alta::recognise(std::string_view text) {
  LineReader lines(text.substr(0, 65536), "");
  while (auto line = lines.next()) {
    if (line->starts_with("#DIM")) return true;
    if (!line->empty() && !line->starts_with('#')) return false;
  }
  return false;
}

Table Alta::parse(std::string_view text, const std::string& place) {
  const Parametrisation* inputs = nullptr;
  std::size_t input_count = 0, output_count = 0, uncertainties = 0;
  bool with_cosine = false;
  std::string sample;
  std::vector<double> rows;  // inputs and outputs
  const auto list = [](const auto& names) {
    std::string result;
    for (const auto& entry : names) result += (result.empty() ? "" : ", ") + std::string(entry.name);
    return result;
  };
  LineReader lines(text, place);
  std::vector<double> row;
  while (auto line = lines.next()) {
    if (line->starts_with('#')) {
      std::string_view rest = *line;
      const std::string_view key = next_word(rest);
      if (key == "#DIM") {
        const auto in = parse_double(next_word(rest)), out = parse_double(next_word(rest));
        if (!in || !out || !(*in >= 1 && *in <= 6) || !(*out == 1 || *out == 3)) {
          throw lines.error("#DIM wants 1 to 6 inputs and 1 or 3 outputs");
        }
        input_count = static_cast<std::size_t>(*in);
        output_count = static_cast<std::size_t>(*out);
      } else if (key == "#VS") {
        uncertainties = 0;
        for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
          const auto count = parse_double(word);
          if (!count || !(*count == 0 || *count == 1 || *count == 2)) throw lines.error("#VS wants 0, 1 or 2");
          uncertainties += static_cast<std::size_t>(*count);
        }
      } else if (key == "#PARAM_IN") {
        const std::string_view name = next_word(rest);
        const auto found = std::find_if(parametrisations.begin(), parametrisations.end(),
                                        [&](const Parametrisation& p) { return p.name == name; });
        if (found == parametrisations.end()) {
          throw lines.error("parametrisation '" + std::string(name) + "' is not read",
                            "convert the file with ALTA to one of " + list(parametrisations));
        }
        inputs = &*found;
      } else if (key == "#PARAM_OUT") {
        const std::string_view name = next_word(rest);
        with_cosine = name == "INV_STERADIAN_COSINE_FACTOR";
        if (!with_cosine && name != "INV_STERADIAN") {
          throw lines.error("output '" + std::string(name) + "' is not read",
                            "convert the file with ALTA to INV_STERADIAN");
        }
      } else if (key == "#SAMPLE") {
        sample = rest;
        for (char& c : sample)
          c = static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) > 0x7e ? ' ' : c;
      }
      continue;
    }
    std::string_view rest = *line;
    row.clear();
    for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
      const auto value = parse_double(word);
      if (!value || !std::isfinite(*value))
        throw lines.error("column " + std::to_string(row.size() + 1) + " is no number");
      row.push_back(*value);
    }
    if (row.empty()) continue;
    if (input_count == 0 || !inputs) throw lines.error("data before #DIM and #PARAM_IN");
    if (inputs->inputs != input_count) {
      throw lines.error("#DIM names " + std::to_string(input_count) + " inputs, " + std::string(inputs->name) +
                        " has " + std::to_string(inputs->inputs));
    }
    if (row.size() != input_count + output_count + uncertainties) {
      throw lines.error(std::to_string(row.size()) + " columns instead of " +
                        std::to_string(input_count + output_count + uncertainties));
    }
    rows.insert(rows.end(), row.begin(), row.begin() + static_cast<std::ptrdiff_t>(input_count + output_count));
  }
  if (rows.empty()) throw lines.error("no data");

  Table table;
  table.coordinates = Coordinates::list;
  table.grid = {
      .theta_i = {"block", "", {0.0}, false}, .theta_o = {"file", "", {0.0}, false}, .phi = {"sample", "", {}, false}};
  const std::size_t columns = input_count + output_count, count = rows.size() / columns;
  for (std::size_t k = 0; k < count; ++k) table.grid.phi.values.push_back(static_cast<double>(k));
  table.channels = static_cast<int>(output_count);
  table.allocate();
  for (std::size_t entry = 0; entry < count; ++entry) {
    const double* x = rows.data() + entry * columns;
    const Pair pair = inputs->directions(x);
    constexpr double least_cosine = 1e-4;
    table.valid[entry] = pair.wi.z > least_cosine && pair.wo.z > least_cosine ? 1 : 0;
    table.set_directions(entry, pair.wi, pair.wo);
    // The file says nothing of what an entry stands for: all alike.
    table.measure[entry] = static_cast<float>(measured_sine(pair.wi) * measured_sine(pair.wo));
    if (!table.valid[entry]) continue;
    for (std::size_t c = 0; c < output_count; ++c) {
      table.values[c * count + entry] = to_float(x[input_count + c] / (with_cosine ? pair.wo.z : 1.0));
    }
  }
  table.model = "measured";
  table.parameters = {
      {"format", "alta"}, {"parametrisation", inputs->name}, {"description", sample}, {"isotropic", inputs->isotropic}};
  table.method = "measured";
  table.mask_what_is_not_finite(0, table.entries());
  return table;
}

std::string Alta::text(const Table& table) {
  if (table.parameter_rows() > 1) {
    throw Error(ExitCode::usage, "the table has parameter axes, ALTA text has none", "", "choose a row with --set");
  }
  const std::string_view name = table.coordinates == Coordinates::spherical      ? "ISOTROPIC_TV_TL_DPHI"
                                : table.coordinates == Coordinates::rusinkiewicz ? "RUSIN_TH_TD_PD"
                                                                                 : "SPHERICAL_TL_PL_TV_PV";
  std::string result = "#DIM " + std::to_string(table.coordinates == Coordinates::list ? 4 : 3) + " " +
                       std::to_string(table.channels) + "\n#VS 0\n#PARAM_IN " + std::string(name) +
                       "\n#PARAM_OUT INV_STERADIAN\n";
  const auto append = [&](auto value) {
    std::array<char, 40> digits;
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    result.append(digits.data(), end);
    result += ' ';
  };
  const auto angle = [](const Axis& axis, std::size_t index) { return radians(axis.values[index]); };
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (!table.valid[entry]) continue;
    const double on_line = angle(table.grid.theta_o, table.theta_o_index(entry));
    const double on_column = angle(table.grid.theta_i, table.theta_i_index(entry));
    if (table.coordinates == Coordinates::list) {
      const Direction wi = table.wi(entry), wo = table.wo(entry);
      for (const Direction& w : {wi, wo}) {
        append(polar(w));
        append(std::atan2(w.y, w.x));
      }
    } else {
      append(on_line);
      append(on_column);
      append(angle(table.grid.phi, table.phi_index(entry)));
    }
    for (int c = 0; c < table.channels; ++c) append(table.value(entry, c));
    result.back() = '\n';
  }
  return result;
}

}  // namespace lobefit
