// lobefit eval, albedo: values of anything that has a BRDF.
#include <fmt/format.h>

#include <fstream>
#include <iostream>
#include <sstream>

#include "cli/arguments.h"
#include "reference/albedo.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

struct EvalArguments {
  std::string name, csv, output;
  std::vector<std::string> settings, wi, wo;
};

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells;
  std::stringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) {
    const auto begin = cell.find_first_not_of(" \t\r");
    cells.push_back(begin == std::string::npos ? "" : cell.substr(begin, cell.find_last_not_of(" \t\r") - begin + 1));
  }
  return cells;
}

/// Runs `read` and turns a complaint into one about a line of a file.
template <class Read>
auto at_line(const std::string& place, Read&& read) {
  try {
    return read();
  } catch (const Error& error) {
    throw error.inside(ExitCode::invalid_input, place);
  }
}

/// The same rows with values: columns f, or r, g, b.
std::string evaluate_csv(const Source& source, const std::string& name) {
  std::string text;
  if (name == "-") {
    std::ostringstream content;
    content << std::cin.rdbuf();
    text = content.str();
  } else {
    text = read_file(name);
  }
  const std::string file = name == "-" ? "stdin" : name;
  std::stringstream stream(text);
  std::string line;
  if (!std::getline(stream, line)) {
    throw Error(ExitCode::invalid_input, "no header", file, "start with a line theta_i,phi_i,theta_o,phi_o");
  }
  const std::vector<std::string> header = split(line);
  std::array<std::size_t, 4> columns;
  const std::array<std::string, 4> wanted{"theta_i", "phi_i", "theta_o", "phi_o"};
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto found = std::find(header.begin(), header.end(), wanted[i]);
    if (found == header.end()) {
      throw Error(ExitCode::invalid_input, "no column '" + wanted[i] + "'", file + ", line 1",
                  "the header needs theta_i, phi_i, theta_o and phi_o");
    }
    columns[i] = static_cast<std::size_t>(found - header.begin());
  }
  const auto trim = [](std::string& row) {
    while (!row.empty() && (row.back() == '\r' || row.back() == ' ')) row.pop_back();
  };
  trim(line);
  std::string result = line + (source.channels == 1 ? ",f\n" : ",r,g,b\n");
  for (int number = 2; std::getline(stream, line); ++number) {
    trim(line);
    if (line.empty()) continue;
    const std::string place = file + ", line " + std::to_string(number);
    const std::vector<std::string> cells = split(line);
    if (cells.size() != header.size()) {
      throw Error(ExitCode::invalid_input, fmt::format("{} cells, the header has {}", cells.size(), header.size()),
                  place, "give each row all columns");
    }
    const Rgb f = at_line(place, [&] {
      const Direction wi = parse_direction(cells[columns[0]] + "," + cells[columns[1]], "theta_i,phi_i", source.sphere);
      const Direction wo = parse_direction(cells[columns[2]] + "," + cells[columns[3]], "theta_o,phi_o", source.sphere);
      return source.evaluate(wi, wo);
    });
    result +=
        source.channels == 1 ? fmt::format("{},{}\n", line, f.x) : fmt::format("{},{},{},{}\n", line, f.x, f.y, f.z);
  }
  return result;
}

}  // namespace

void add_eval(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "eval",
      "BRDF of a model, a reference (by quadrature) or a file (interpolated), in 1/sr without cosine\n"
      "  lobefit eval proxima --set alpha=0.5 --set albedo=0.8,0.5,0.2 --wi 60,0 --wo 30,180\n"
      "  lobefit eval burley --csv pairs.csv -o values.csv\n"
      "  lobefit eval aurora_white_rgb.bsdf --wi 30,0 --wo 30,180");
  const auto a = std::make_shared<EvalArguments>();
  verb->add_option("NAME", a->name, "Model, reference or table file")->required();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  add_repeatable(*verb, "--wi", a->wi, "Light: THETA,PHI in degrees (repeatable)");
  add_repeatable(*verb, "--wo", a->wo, "Viewer: THETA,PHI in degrees (repeatable)");
  verb->add_option("--csv", a->csv, "Pairs from a CSV file (- is stdin): theta_i,phi_i,theta_o,phi_o in degrees");
  verb->add_option("-o,--output", a->output, "File for the CSV result (default: stdout)");
  verb->callback([&context, a] {
    const Source source = find_source(a->name, a->settings);
    if (!a->csv.empty()) {
      if (context.json) throw Error(ExitCode::usage, "--csv answers in CSV", "eval", "leave out --json");
      write_or_print(evaluate_csv(source, a->csv), a->output, context.force);
      return;
    }
    if (a->wi.empty() || a->wi.size() != a->wo.size()) {
      throw Error(ExitCode::usage,
                  fmt::format("{} directions to the light, {} to the viewer", a->wi.size(), a->wo.size()), "eval",
                  "give --wi and --wo in pairs, or --csv FILE");
    }
    Json values = Json::array();
    for (std::size_t i = 0; i < a->wi.size(); ++i) {
      const Rgb f = source.evaluate(parse_direction(a->wi[i], "--wi", source.sphere),
                                    parse_direction(a->wo[i], "--wo", source.sphere));
      values.push_back({{"wi", parse_numbers(a->wi[i], "--wi")},
                        {"wo", parse_numbers(a->wo[i], "--wo")},
                        {"f", rgb_json(f, source.channels)}});
      if (!context.json) fmt::print("{}\n", rgb_text(f, source.channels));
    }
    if (context.json) {
      std::cout << Json{{"model", source.label}, {"params", source.parameters}, {"values", values}}.dump(2) << "\n";
    }
  });
}

void add_albedo(CLI::App& app, Context& context) {
  CLI::App* verb =
      app.add_subcommand("albedo",
                         "Directional albedo: the integral of f times cosine over the other direction, by quadrature\n"
                         "(error: difference of the last two refinements) or, of references that have none, by Monte\n"
                         "Carlo (standard error). Over both sides where light passes (there --fixed light conserves\n"
                         "energy: refraction compresses what a view sees); of a fibre without cosine.\n"
                         "  lobefit albedo eon --set roughness=1 --theta 0,45,80");
  struct Arguments {
    std::string name, theta, fixed = "view";
    std::vector<std::string> settings;
    SamplingOptions options;
    CLI::Option* samples = nullptr;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("NAME", a->name, "Model, reference or table file")->required();
  add_repeatable(*verb, "--set", a->settings, "NAME=VALUE or NAME=r,g,b (repeatable)");
  verb->add_option("--theta", a->theta, "Angles of the fixed direction in degrees, separated by commas")->required();
  verb->add_option("--fixed", a->fixed, "Which direction is fixed (they differ for models that are not reciprocal)")
      ->check(CLI::IsMember({"view", "light"}))
      ->capture_default_str();
  a->samples = verb->add_option("--samples", a->options.samples, "By Monte Carlo with so many samples (references)")
                   ->check(CLI::Range(std::uint64_t{replicate_count}, most_samples));
  verb->callback([&context, a] {
    const Source source = find_source(a->name, a->settings);
    Json albedo = Json::array(), error = Json::array();
    const std::vector<double> angles = parse_numbers(a->theta, "--theta");
    for (const double theta : angles) parse_direction(number_text(theta) + ",0", "--theta", source.sphere);
    const AlbedoDomain domain = source.fibre    ? AlbedoDomain::fibre
                                : source.sphere ? AlbedoDomain::sphere
                                                : AlbedoDomain::hemisphere;
    const FixedDirection fixed = a->fixed == "view" ? FixedDirection::view : FixedDirection::light;
    const bool random = a->samples->count() > 0 || (source.integrator && !source.integrator->has_exact());
    if (random && !source.integrator) {
      throw Error(ExitCode::usage, "only references are sampled", "--samples", "leave it out: quadrature is used");
    }
    const auto monitor = context.monitor();
    for (const double theta : angles) {
      Albedo result;
      if (random) {
        SamplingOptions options = a->options;
        options.seed = context.seed;
        const Estimate estimated =
            estimate_albedo(*source.integrator, radians(theta), fixed, domain, options, monitor.get());
        result = {estimated.f, estimated.stderr_f};
      } else if (source.albedo_of_light && fixed == FixedDirection::light) {
        result = source.albedo_of_light(radians(theta));
      } else {
        result = directional_albedo(source.evaluate, radians(theta), fixed, domain, 1e-6, monitor.get());
      }
      albedo.push_back(rgb_json(result.value, source.channels));
      error.push_back(rgb_json(result.error, source.channels));
      if (!context.json) {
        fmt::print("{:>8} deg  {}  +- {:.1e}\n", theta, rgb_text(result.value, source.channels), result.error.x);
      }
    }
    if (context.json) std::cout << Json{{"theta", angles}, {"albedo", albedo}, {"stderr", error}}.dump(2) << "\n";
  });
}

}  // namespace lobefit
