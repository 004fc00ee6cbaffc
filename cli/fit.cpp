// lobefit fit: from a table to parameters.
#include <fmt/format.h>

#include <iostream>

#include "cli/fit_batch.h"
#include "cli/metrics_text.h"
#include "reference/formats/neural_brdf.h"
#include "reference/output_file.h"
#include "report/fit_text.h"
#include "report/material_figure.h"

namespace lobefit {

namespace {

struct FitArguments {
  std::string model, output;
  std::vector<std::string> tables, materials;
  FitJobSettings settings;
  std::string figure;
  bool resume = false, figures = false;
};

/// Every file, or every chosen material of the files that hold several.
std::vector<FitSource> find_sources(const FitArguments& a) {
  std::vector<FitSource> sources;
  for (const std::string& path : a.tables) {
    if (a.materials.empty()) {
      sources.push_back({path, ""});
      continue;
    }
    std::vector<std::string> names = a.materials;
    if (names.front() == "all") {
      const std::string text = read_file(path);
      if (!NeuralBrdf::recognise(text))
        throw Error(ExitCode::usage, "the file holds one material only", path, "leave out --material");
      names = NeuralBrdf::materials(text);
    }
    for (const std::string& name : names) sources.push_back({path, name});
  }
  return sources;
}

void run_one(const FitArguments& a, const FitSource& source, const Context& context) {
  std::optional<OutputFile> file;
  if (!a.output.empty()) file.emplace(a.output, context.force);
  const auto monitor = context.monitor();
  FitJobSettings settings = a.settings;
  settings.figure = !a.figure.empty();
  const FitJob job = run_fit(settings, source, context, *monitor);
  if (file) {
    file->write(job.document.dump(2) + "\n");
    file->commit();
  }
  if (settings.figure) write_figure(job.figure, a.figure, context.force, material_figure_size());
  if (context.json) {
    std::cout << job.document.dump(2) << "\n";
  } else {
    fmt::print("{}{}\n{}", fit_text(job.fit), tiers_text(job.tiers), metrics_text(job.report));
  }
  if (!job.fit.solution.converged) {
    throw Error(ExitCode::not_converged, "the fit did not converge: " + job.fit.solution.termination, a.model,
                "try --starts 16, or free fewer parameters");
  }
}

}  // namespace

void add_fit(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "fit",
      "Fit a model's parameters to a table, with uncertainty\n"
      "  lobefit fit proxima truth.exr --free a,b -o fit.json\n"
      "  lobefit fit callisto blue.bsdf --compare-tiers --holdout 0.2 -o blue.json\n"
      "  lobefit fit callisto measured/*.bsdf -o fits/             every file; fits/summary.md, .csv, .json\n"
      "  lobefit fit callisto merl_nbrdf.txt --material all -o fits/\n"
      "Parameters that the table's axes set follow the axes; those that its reference states keep those values.\n"
      "ci95 covers the table's own Monte Carlo error, misfit_stderr what the model's misfit leaves open.\n"
      "Dense measurements (MERL, isotropic RGL) are taken at 45 x 45 x 90 angles (--grid measured) with weights\n"
      "sin theta_i sin theta_o, fitted lobe by lobe from six starts, and their ci95 tells how far a value would move "
      "had\n"
      "other ranges of directions been measured.");
  const auto a = std::make_shared<FitArguments>();
  FitJobSettings& settings = a->settings;
  verb->add_option("MODEL", a->model, "Model: see `lobefit models`")->required();
  verb->add_option("TABLE", a->tables, "Tables or measured files (EXR, MERL, RGL, UTIA, ALTA, Klems, NBRDF weights)")
      ->required();
  verb->add_option("-o,--output", a->output, "Fit to write (.json); for several materials a folder");
  add_repeatable(*verb, "--material", a->materials, "Material of a file that holds several (repeatable), or all")
      ->delimiter(',');
  add_repeatable(*verb, "--free", settings.free,
                 "Parameters to fit, NAME or NAME=START (repeatable, or separated by commas)")
      ->delimiter(',');
  add_repeatable(*verb, "--fix", settings.fix, "Parameters to hold, NAME or NAME=VALUE (repeatable)");
  add_repeatable(*verb, "--bound", settings.bounds,
                 "NAME=LOWER,UPPER: narrower bounds of a free parameter (repeatable); staged fits keep "
                 "diffuse_fresnel_falloff and retroreflection_falloff below 0.95");
  add_repeatable(*verb, "--map", settings.mappings,
                 "NAME=SCALE*AXIS^POWER: a table axis sets a parameter (repeatable)");
  verb->add_option("--tier", settings.tier, "Without --free: fit the parameters up to this tier")
      ->check(CLI::IsMember({"base", "advanced", "full"}))
      ->capture_default_str();
  verb->add_flag("--compare-tiers", settings.compare_tiers, "Fit each tier, and say what it buys");
  verb->add_option("--lobes", settings.lobes, "Without --free: specular lobes, of models that may have two")
      ->check(CLI::Range(1, 2))
      ->capture_default_str();
  verb->add_option("--metric", settings.metric,
                   "cosine (pi f cos), brdf (pi f), log (log(1 + f cos)), cube_root ((f cos)^1/3)")
      ->capture_default_str();
  verb->add_option("--weights", settings.weights,
                   "uniform, or a product of sin_theta_i, sin_theta_o, cos_theta_i, cos_theta_o, quadrature, "
                   "inverse_variance (default: uniform; of dense measurements sin_theta_i,sin_theta_o)");
  verb->add_option("--loss", settings.loss, "none, huber[:SCALE] or cauchy[:SCALE], SCALE in units of the metric")
      ->capture_default_str();
  verb->add_option("--grid", settings.grid, "Angles to fit at: native, small, default, fine, measured, or a JSON file")
      ->capture_default_str();
  verb->add_option("--directions", settings.directions,
                   "Fit a stratified sample of so many entries, 0: all (default: all; of dense measurements 50000)");
  verb->add_option("--starts", settings.starts,
                   "Start points: the first is the model's default, or with --staged a guess from the table (default: "
                   "1; of dense measurements 6)")
      ->check(CLI::Range(1, 10000));
  CLI::Option* const staged =
      verb->add_flag("--staged", settings.staged,
                     "Grow the fit lobe by lobe from a guess made from the table (default for dense measurements)");
  verb->add_flag("--not-staged", settings.not_staged, "Start from the model's defaults all the same")->excludes(staged);
  verb->add_flag("--hops", settings.hops,
                 "With --staged: let single lobes of the best start begin anew, out of valleys where one lobe plays "
                 "another's part; several times the work");
  verb->add_option("--prior", settings.prior,
                   "With --staged: what the data leave open is pulled to neutral values; a parameter's whole width "
                   "costs the square of this share of the misfit")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
  verb->add_option("--intervals", settings.intervals,
                   "ci95 from the table's own errors (data), or from blocks of directions (default: data; of dense "
                   "measurements blocks)")
      ->check(CLI::IsMember({"data", "blocks"}));
  verb->add_option(
          "--holdout", settings.holdout,
          "Fraction of entries kept out of the fit and scored; of dense measurements whole blocks of directions")
      ->check(CLI::Range(0.0, 0.9));
  verb->add_option("--figure", a->figure, "Slices of table and fit to draw (.svg or .png)");
  verb->add_flag("--figures", a->figures, "Of several materials: NAME.svg beside each fit");
  verb->add_flag("--resume", a->resume, "Of several materials: keep the fits that the folder holds already");
  verb->callback([&context, a] {
    a->settings.model = &find_model(a->model);
    parse_quantity(a->settings.metric);
    const std::vector<FitSource> sources = find_sources(*a);
    const bool folder = std::filesystem::is_directory(a->output) || a->output.ends_with('/');
    if (sources.size() == 1 && !folder) {
      run_one(*a, sources.front(), context);
    } else if (a->output.empty()) {
      throw Error(ExitCode::usage, "several materials, and nowhere to write their fits", "-o", "name a folder");
    } else {
      a->settings.figure = a->figures;
      run_fit_batch(a->settings, sources, a->output, a->resume, context);
    }
  });
}

}  // namespace lobefit
