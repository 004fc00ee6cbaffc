// lobefit fit: from a table to parameters.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/fit_text.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

struct FitArguments {
  std::string model, table, output, tier = "full", metric = "log", weights = "uniform", loss = "none";
  std::vector<std::string> free, fix, mappings;
  FitOptions options;
};

/// "huber:0.02" → Huber at 0.02 of the metric's quantity.
void parse_loss(const std::string& text, FitOptions& options) {
  const std::size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const auto found = std::find(loss_names.begin(), loss_names.end(), name);
  if (found == loss_names.end()) {
    throw Error(ExitCode::usage, "unknown loss '" + name + "'", "--loss",
                "choose none, huber or cauchy, such as huber:0.05");
  }
  options.loss = static_cast<Loss>(found - loss_names.begin());
  if (colon == std::string::npos) return;
  options.loss_scale = parse_number(text.substr(colon + 1), "--loss");
  if (options.loss_scale <= 0.0)
    throw Error(ExitCode::usage, "the scale must be positive", "--loss", "such as huber:0.05");
}

/// Which parameters are free, and the values of the others.
std::vector<std::string> choose_free(const FitArguments& a, const Table& table, const FitOptions& options,
                                     ParameterValues& values) {
  // NAME or NAME=VALUE: the names, their values set.
  const auto names_of = [&](const std::vector<std::string>& texts) {
    std::vector<std::string> names;
    for (const std::string& text : texts) {
      const std::size_t equals = text.find('=');
      names.push_back(text.substr(0, equals));
      values.info(names.back());
      if (equals != std::string::npos) values.set_text(names.back(), std::string_view(text).substr(equals + 1));
    }
    return names;
  };
  const std::vector<std::string> fixed = names_of(a.fix);
  std::vector<std::string> free = names_of(a.free);
  if (a.free.empty()) {
    const Tier tier = a.tier == "base" ? Tier::base : a.tier == "advanced" ? Tier::advanced : Tier::full;
    const bool from_reference = find_reference_or_null(table.model) != nullptr;
    for (const std::string& name : free_parameters(values, table, options.mappings, tier)) {
      // What the reference's own settings say is known, not fitted.
      if (!(from_reference && table.parameters.contains(name))) free.push_back(name);
    }
  }
  for (const std::string& name : fixed) {
    if (!a.free.empty() && std::find(free.begin(), free.end(), name) != free.end()) {
      throw Error(ExitCode::usage, "parameter '" + name + "' is both free and fixed", "fit",
                  "drop it from one of them");
    }
    std::erase(free, name);
  }
  return free;
}

}  // namespace

void add_fit(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "fit",
      "Fit a model's parameters to a table, with uncertainty\n"
      "  lobefit fit proxima truth.exr --free a,b -o fit.json\n"
      "Parameters that the table's axes set follow the axes; those that its reference states keep those values.\n"
      "ci95 covers the table's own Monte Carlo error, misfit_stderr what the model's misfit leaves open.");
  const auto a = std::make_shared<FitArguments>();
  verb->add_option("MODEL", a->model, "Model: see `lobefit models`")->required();
  verb->add_option("TABLE", a->table, "Table or measured file (EXR, MERL, RGL, UTIA, ALTA, Klems)")->required();
  verb->add_option("-o,--output", a->output, "Fit to write (.json)");
  add_repeatable(*verb, "--free", a->free, "Parameters to fit, NAME or NAME=START (repeatable, or separated by commas)")
      ->delimiter(',');
  add_repeatable(*verb, "--fix", a->fix, "Parameters to hold, NAME or NAME=VALUE (repeatable)");
  add_repeatable(*verb, "--map", a->mappings, "NAME=SCALE*AXIS^POWER: a table axis sets a parameter (repeatable)");
  verb->add_option("--tier", a->tier, "Without --free: fit the parameters up to this tier")
      ->check(CLI::IsMember({"base", "advanced", "full"}))
      ->capture_default_str();
  verb->add_option("--metric", a->metric,
                   "cosine (pi f cos), brdf (pi f), log (log(1 + f cos)), cube_root ((f cos)^1/3)")
      ->capture_default_str();
  verb->add_option(
          "--weights", a->weights,
          "uniform, or a product of sin_theta_i, sin_theta_o, cos_theta_i, cos_theta_o, quadrature, inverse_variance")
      ->capture_default_str();
  verb->add_option("--loss", a->loss, "none, huber[:SCALE] or cauchy[:SCALE], SCALE in units of the metric")
      ->capture_default_str();
  verb->add_option("--starts", a->options.starts, "Start points: the first is the model's default")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  verb->add_option("--holdout", a->options.holdout, "Fraction of entries kept out of the fit and scored")
      ->check(CLI::Range(0.0, 0.9));
  verb->callback([&context, a] {
    const Model& model = find_model(a->model);
    FitOptions options = a->options;
    options.quantity = parse_quantity(a->metric);
    options.weights = parse_weights(a->weights);
    options.seed = context.seed;
    parse_loss(a->loss, options);
    for (const std::string& text : a->mappings) options.mappings.push_back(AxisMapping::parse(text));
    const Table table = read_table(a->table);
    ParameterValues values = with_table_parameters(model.defaults(), table);
    options.free = choose_free(*a, table, options, values);
    std::optional<OutputFile> file;
    if (!a->output.empty()) file.emplace(a->output, context.force);
    const auto monitor = context.monitor();
    const Fit result = fit(model, values, table, options, *monitor);
    const Json document = result.json(context.command, sha256_of_file(a->table));
    if (file) {
      file->write(document.dump(2) + "\n");
      file->commit();
    }
    if (context.json) {
      std::cout << document.dump(2) << "\n";
    } else {
      fmt::print("{}", fit_text(result));
    }
    if (!result.solution.converged) {
      throw Error(ExitCode::not_converged, "the fit did not converge: " + result.solution.termination, a->model,
                  "try --starts 16, or free fewer parameters");
    }
  });
}

}  // namespace lobefit
