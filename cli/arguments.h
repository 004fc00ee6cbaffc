// What the verbs' arguments have in common.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fit/fit.h"
#include "models/registry.h"
#include "reference/formats/brdf_file.h"
#include "reference/render.h"

namespace lobefit {

/// Options that every verb takes, and the command line itself.
struct Context {
  int threads = 0;  // 0: all
  std::uint64_t seed = 1;
  bool quiet = false, verbose = false, progress = false, json = false, force = false;
  /// The command line without what can't change the result: threads, output, shard and display options.
  std::string command;

  std::unique_ptr<Monitor> monitor() const;
  /// A message for people on stderr, unless --quiet.
  void say(const std::string& message) const;
};

// One function per verb: adds it to the program; it runs through CLI11's callback.
void add_models(CLI::App& app, Context& context);
void add_eval(CLI::App& app, Context& context);
void add_sample(CLI::App& app, Context& context);
void add_albedo(CLI::App& app, Context& context);
void add_albedo_table(CLI::App& app, Context& context);
void add_references(CLI::App& app, Context& context);
void add_reference(CLI::App& app, Context& context);
void add_render(CLI::App& app, Context& context);
void add_table(CLI::App& app, Context& context);
void add_table_compare(CLI::App& tables, Context& context);
void add_sphere(CLI::App& app, Context& context);
void add_fit(CLI::App& app, Context& context);
void add_refit(CLI::App& app, Context& context);
void add_report(CLI::App& app, Context& context);
void add_check(CLI::App& app, Context& context);
void add_export(CLI::App& app, Context& context);
void add_plot(CLI::App& app, Context& context);
void add_slab(CLI::App& app, Context& context);
void add_study(CLI::App& app, Context& context);

/// An option that may be given several times, one value each: CLI11's own would swallow what follows.
inline CLI::Option* add_repeatable(CLI::App& verb, const std::string& name, std::vector<std::string>& values,
                                   const std::string& doc) {
  return verb.add_option(name, values, doc)->allow_extra_args(false);
}

/// Sets every NAME=VALUE of `settings`; throws Error(usage).
void set_parameters(ParameterValues& values, const std::vector<std::string>& settings);
/// --axis NAME=v1,v2,…
std::vector<Axis> parse_axes(const std::vector<std::string>& texts);
/// THETA,PHI in degrees, theta in [0, 90), or [0, 180] where directions may come from below.
Direction parse_direction(const std::string& text, const char* option, bool sphere = false);
/// `3` or three comma-separated components.
Json rgb_json(const Rgb& value, int channels);
std::string rgb_text(const Rgb& value, int channels);
/// Whether an argument names a file rather than a model.
bool is_file(const std::string& name);
/// Prints, or writes a whole file; `output` empty or "-" is stdout.
void write_or_print(const std::string& text, const std::string& output, bool force);

/// Anything that has a BRDF: a model, a reference (by quadrature) or a table file (interpolated).
struct Source {
  std::string label;
  int channels = 3;
  bool sphere = false;  // directions may come from below
  std::function<Rgb(const Direction& wi, const Direction& wo)> evaluate;
  Json parameters;
  std::shared_ptr<const Integrator> integrator = nullptr;  // of a reference
  bool fibre = false;                                      // z is its axis
  bool isotropic = false;                                  // known to be
  /// Directional albedo with the light at `theta` radians, of files that have their own quadrature.
  std::function<Albedo(double theta)> albedo_of_light = nullptr;
  /// Of a model, with `flat` for parameters; null for all else.
  const Model* model = nullptr;
  std::vector<double> flat = {};
};
/// One parameter row of a file: that of `settings`; a table without axes has one. Throws Error(usage).
std::size_t find_row(const Table& table, const std::vector<std::string>& settings);
Source find_source(const std::string& name, const std::vector<std::string>& settings);
/// The source's values, nothing where a file has none. Throws Error(usage) for a reference without quadrature.
std::function<std::optional<Rgb>(const Direction& wi, const Direction& wo)> brdf_of(const Source& source);
/// Parameters as JSON: numbers, lists, choices by name.
Json parameters_json(const ParameterValues& values);

/// A model with its parameters: by name, or from a fit's JSON file.
struct ModelChoice {
  const Model* model;
  ParameterValues values;
  std::vector<AxisMapping> mappings;
  std::optional<Fit> fit;
};
ModelChoice find_model_or_fit(const std::string& name, const std::vector<std::string>& settings);

}  // namespace lobefit
