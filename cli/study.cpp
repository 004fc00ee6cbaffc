// lobefit study: witnesses for the references.
#include <fmt/format.h>

#include <algorithm>
#include <iostream>

#include "cli/arguments.h"
#include "cli/output_folder.h"
#include "reference/height_field/study.h"
#include "reference/height_field/tracer.h"
#include "reference/output_file.h"
#include "report/figure.h"

namespace lobefit {

namespace {

struct HeightFieldArguments {
  HeightFieldOptions options;
  std::string theta = "0,30,60,80", output;
};

Json measured_json(const MeanAndError& value) { return {{"value", value.mean}, {"stderr", value.standard_error}}; }

Json comparison_json(const Comparison& c) {
  return {{"surface", measured_json(c.surface)}, {"smith", measured_json(c.smith)}};
}

Json study_json(const HeightFieldStudy& study, const Context& context) {
  Json pairs = Json::array(), views = Json::array();
  for (const HeightFieldPair& p : study.pairs) {
    pairs.push_back({{"theta_o", p.theta_o},
                     {"theta_i", p.theta_i},
                     {"phi", p.phi},
                     {"first", comparison_json(p.first)},
                     {"first_separable", p.separable},
                     {"first_unmasked", p.unmasked},
                     {"second", comparison_json(p.second)},
                     {"all", comparison_json(p.all)}});
  }
  for (const HeightFieldView& v : study.views) {
    views.push_back({{"theta_o", v.theta_o},
                     {"facing_area", comparison_json(v.facing_area)},
                     {"albedo",
                      {{"first", comparison_json(v.first)},
                       {"second", comparison_json(v.second)},
                       {"rest", comparison_json(v.rest)}}}});
  }
  const HeightFieldSlopes& s = study.slopes;
  return {{"study", "height-field"},
          {"alpha", study.options.alpha},
          {"surfaces", study.options.surfaces},
          {"degrees_of_freedom", study.degrees_of_freedom()},
          {"cells", study.options.cells},
          {"correlation_length", study.options.correlation_length},
          {"samples", study.options.samples},
          {"paths", study.paths},
          {"paths_lost", study.lost},
          {"slopes",
           {{"rms_x", measured_json(s.rms_x)},
            {"rms_y", measured_json(s.rms_y)},
            {"kurtosis_x", measured_json(s.kurtosis_x)},
            {"kurtosis_y", measured_json(s.kurtosis_y)},
            {"correlation", measured_json(s.correlation)}}},
          {"pairs", pairs},
          {"views", views},
          {"conclusion", study.conclusion()},
          {"seed", study.options.seed},
          {"version", LOBEFIT_VERSION},
          {"command", context.command}};
}

std::string study_text(const HeightFieldStudy& study) {
  const HeightFieldOptions& o = study.options;
  const auto measured = [](const MeanAndError& x, double scale, int digits) {
    return fmt::format("{:.{}f} ± {:.{}f}", scale * x.mean, digits, scale * x.standard_error, digits);
  };
  const auto compared = [&](const Comparison& c, double scale) {
    return fmt::format("{:>17}  {:.4f} {:>+6.1f} % {:>+6.1f} σ", measured(c.surface, scale, 4), scale * c.smith.mean,
                       100.0 * c.difference(), c.deviations());
  };
  std::string text = fmt::format(
      "{} Gaussian surfaces, alpha {:g}, {} x {} cells, correlation length {:g} cells; {} paths each and view.\n"
      "Errors are standard errors from surface to surface, {} degrees of freedom; σ is the difference in these.\n\n",
      o.surfaces, o.alpha, o.cells, o.cells, o.correlation_length, o.samples, study.degrees_of_freedom());
  const HeightFieldSlopes& s = study.slopes;
  text += fmt::format(
      "Facet slopes (Gaussian): rms/(alpha/√2) along x {} (1), along y {} (1);\n"
      "  kurtosis {} (3), {} (3); correlation of x and y {} (0)\n\n",
      measured(s.rms_x, 1, 4), measured(s.rms_y, 1, 4), measured(s.kurtosis_x, 1, 3), measured(s.kurtosis_y, 1, 3),
      measured(s.correlation, 1, 4));

  text += "π f per unit of albedo; difference of the surface from Smith's theory. φ = 0 is the retro side.\n";
  text += fmt::format("  {:>4} {:>4} {:>4}  {:^43}  {:>9} {:>9}  {:^43}\n", "θo", "θi", "φ",
                      "one bounce: surface, correlated Smith", "separable", "unmasked",
                      "second bounce: surface, Smith's walk");
  for (const HeightFieldPair& p : study.table()) {
    const auto off = [&](double theory) { return 100.0 * (p.first.surface.mean / theory - 1.0); };
    text += fmt::format("  {:>4g} {:>4g} {:>4g}  {}  {:>+7.1f} % {:>+7.1f} %  {}\n", p.theta_o, p.theta_i, p.phi,
                        compared(p.first, pi), off(p.separable), off(p.unmasked), compared(p.second, pi));
  }
  text += fmt::format("\nDirectional albedo of the orders at unit albedo (they sum to 1), and area of facing facets\n");
  text += fmt::format("  {:>4}  {:^43}  {:^43}  {:^43}  {:>25}\n", "θo", "one bounce: surface, Smith's walk", "second",
                      "third and on", "facing: surface, Smith");
  for (const HeightFieldView& v : study.views) {
    text += fmt::format("  {:>4g}  {}  {}  {}  {:>17}  {:.4f}\n", v.theta_o, compared(v.first, 1.0),
                        compared(v.second, 1.0), compared(v.rest, 1.0), measured(v.facing_area.surface, 1.0, 4),
                        v.facing_area.smith.mean);
  }
  text += fmt::format("\nPaths lost to rounding: {} of {}\n\n{}\n", study.lost, study.paths, study.conclusion());
  return text;
}

/// The two most grazing views, one bounce above, the second below.
std::string figure_program(const HeightFieldStudy& study) {
  std::vector<double> views = study.options.theta;
  std::ranges::sort(views);
  if (views.size() > 2) views.erase(views.begin(), views.end() - 2);
  const double factor = study.t_quantile(0.05);
  std::string data, panels;
  for (const bool second : {false, true}) {
    for (std::size_t v = 0; v < views.size(); ++v) {
      const std::string name = fmt::format("$order_{}_view_{}", second ? 2 : 1, v);
      data += name + " << EOD\n";
      for (const HeightFieldPair& p : study.slice(views[v])) {
        const Comparison& c = second ? p.second : p.first;
        data += fmt::format("{:g} {:.6g} {:.6g} {:.6g} {:.6g}\n", p.phi == 180.0 ? -p.theta_i : p.theta_i,
                            pi * c.surface.mean, pi * factor * c.surface.standard_error, pi * c.smith.mean,
                            pi * p.separable);
      }
      data += "EOD\n";
      panels += fmt::format("set title '{}, view at {:g}°'\nset key {} left\nset ylabel 'π {{/:Italic f}}_{} / ρ{}'\n",
                            second ? "Second bounce" : "One bounce", views[v], second ? "bottom" : "top",
                            second ? 2 : 1, second ? "²" : "");
      panels += "plot ";
      if (!second) panels += name + " using 1:5 with lines linestyle 3 title 'Smith, separable', ";
      // Bars as strokes of their own: gnuplot's yerrorbars erase what lies around each point.
      panels += fmt::format(
          "{0} using 1:4 with lines linestyle {1} title 'Smith, {2}', "
          "{0} using 1:($2-$3):(0):(2*$3) with vectors nohead linestyle 1 notitle, "
          "{0} using 1:2 with points linestyle 1 title 'explicit surfaces ± 95 %'\n",
          name, second ? 4 : 2, second ? "random walk" : "height-correlated");
    }
  }
  return data +
         fmt::format(
             "set style line 1 linecolor rgb '#000000' linewidth 1 pointtype 7 pointsize 0.5\n"
             "set style line 2 linecolor rgb '#D55E00' linewidth 2\n"
             "set style line 3 linecolor rgb '#0072B2' linewidth 2 dashtype (12,5)\n"
             "set style line 4 linecolor rgb '#009E73' linewidth 2\n"
             "set multiplot layout 2,{} margins screen 0.08,0.97,0.08,0.87 spacing screen 0.08,0.13 title \""
             "{{/*1.25:Bold Lambertian facets, alpha {:g}: {} explicit Gaussian surfaces against Smith's theory}}\\n"
             "in the plane of incidence: retro side at positive θ_i, mirror side at negative\"\n"
             "set grid linecolor rgb '#dddddd' linetype 1\nset border linecolor rgb '#888888'\n"
             "set tics textcolor rgb '#000000'\nset xrange [-90:90]\nset xtics 30\nset yrange [0:*]\n"
             "set xlabel 'signed θ_i (degrees)'\nset key reverse Left samplen 2\n",
             views.size(), study.options.alpha, study.options.surfaces) +
         panels + "unset multiplot\n";
}

void add_height_field(CLI::App& study, Context& context) {
  CLI::App* verb = study.add_subcommand("height-field", "Explicit Gaussian surfaces, traced, against Smith's theory");
  verb->footer(
      "\nA Gaussian height field has Beckmann's slopes. Its facets are Lambertian; rays (Embree) tell what they "
      "reflect\n"
      "once, twice and more often. Smith's theory of the same slopes takes heights and normals at different points as\n"
      "independent; real ones are not, and the table shows where that matters, in % and in standard errors (σ).\n\n"
      "  lobefit study height-field\n"
      "  lobefit study height-field --alpha 1 --surfaces 32 --theta 0,45,75 -o out/height_field\n\n"
      "More --surfaces reduce the errors at grazing angles, more --samples those near the normal. Keep ℓ at 8 cells "
      "or\n"
      "more, and the patch much wider than what a ray at theta crosses: about 2 alpha tan(theta) ℓ. -o writes\n"
      "height_field.png and .svg (the two most grazing views), and result.json. Needs Embree (libembree-dev).");
  verb->fallthrough();
  const auto a = std::make_shared<HeightFieldArguments>();
  verb->add_option("--alpha", a->options.alpha, "Beckmann alpha: √2 times the rms slope along an axis")
      ->check(CLI::Range(0.01, 2.0))
      ->capture_default_str();
  verb->add_option("--surfaces", a->options.surfaces, "Independent surfaces; their spread gives the errors")
      ->check(CLI::Range(8, 4096))
      ->capture_default_str();
  verb->add_option("--samples", a->options.samples, "Paths per surface and view")
      ->check(CLI::Range(std::uint32_t{256}, std::uint32_t{1} << 24))
      ->capture_default_str();
  verb->add_option("--theta", a->theta, "Angles of views, and of the lights listed, in degrees")->capture_default_str();
  verb->add_option("--cells", a->options.cells, "Cells across a surface; even")
      ->check(CLI::Range(32, 2048))
      ->capture_default_str();
  verb->add_option("--correlation-length", a->options.correlation_length,
                   "ℓ in cells; heights correlate as exp(-r²/ℓ²)")
      ->check(CLI::Range(2.0, 512.0))
      ->capture_default_str();
  verb->add_option("-o,--output", a->output, "Folder for the figure and the numbers");
  verb->callback([&context, a] {
    if (!HeightFieldTracer::available()) {
      throw Error(ExitCode::missing_part, "this build has no Embree to trace rays with", "study height-field",
                  "install Debian's package libembree-dev and build again");
    }
    a->options.theta = parse_numbers(a->theta, "--theta");
    a->options.seed = context.seed;
    std::unique_ptr<OutputFolder> folder;
    if (!a->output.empty()) folder = std::make_unique<OutputFolder>(a->output, context.force);
    const auto monitor = context.monitor();
    const HeightFieldStudy result = study_height_field(a->options, *monitor);
    const Json document = study_json(result, context);
    if (folder) {
      OutputFile file(folder->path("result.json"), true);
      file.write(document.dump(2) + "\n");
      file.commit();
      for (const char* extension : {".png", ".svg"}) {
        write_figure(figure_program(result), folder->path(std::string("height_field") + extension), true,
                     {.width = 1100, .height = 820});
      }
      folder->commit();
    }
    if (context.json) {
      std::cout << document.dump(2) << "\n";
    } else {
      fmt::print("{}", study_text(result));
      std::fflush(stdout);
    }
    if (folder) context.say("wrote " + (folder->destination() / "height_field.png").string());
  });
}

}  // namespace

void add_study(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("study",
                                      "Independent witnesses for what the references assume\n"
                                      "  lobefit study height-field      does Smith's theory hold on a real surface?\n"
                                      "Each study has its own --help.");
  verb->require_subcommand(1);
  add_height_field(*verb, context);
}

}  // namespace lobefit
