#include "cli/plot_convergence.h"

#include <algorithm>
#include <cmath>

#include "reference/json_reader.h"
#include "reference/output_file.h"
#include "report/chart.h"

namespace lobefit {

namespace {

/// log10 of the misfit after each step of the last search; steps that found nothing finite are left out.
ChartSeries history_of(const std::string& path) {
  const Fit fit = Fit::from_json(parse_json(read_file(path), path), path);
  ChartSeries series;
  for (std::size_t step = 0; step < fit.solution.history.size(); ++step) {
    const double misfit = fit.solution.history[step];
    if (misfit > 0.0 && std::isfinite(misfit)) {
      series.points.push_back({static_cast<double>(step), std::log10(misfit)});
      series.line.emplace_back(static_cast<double>(step), std::log10(misfit));
    }
  }
  if (series.points.empty()) {
    throw Error(ExitCode::invalid_input, "the fit keeps no history", path, "fit again with this version");
  }
  return series;
}

std::string convergence_figure(const std::vector<std::string>& paths, const std::string& title) {
  ChartPanel panel{.title = "log10 √Σr²", .series = {}, .lower = 0.0, .upper = 0.0};
  std::vector<std::string> labels;
  std::vector<double> heights;
  double steps = 1.0;
  for (const std::string& path : paths) {
    panel.series.push_back(history_of(path));
    labels.push_back(std::filesystem::path(path).stem().string());
    for (const ChartPoint& point : panel.series.back().points) {
      heights.push_back(point.y);
      steps = std::max(steps, point.x);
    }
  }
  const auto [least, most] = std::minmax_element(heights.begin(), heights.end());
  const double margin = std::max(0.05 * (*most - *least), 0.01);
  panel.lower = *least - margin;
  panel.upper = *most + margin;
  return chart_figure({panel}, labels, title, "misfit after each step of the search that won", "step",
                      {.left = 0.0, .right = 1.02 * steps, .tick = std::max(1.0, std::ceil(steps / 10.0))});
}

}  // namespace

void add_plot_convergence(CLI::App& plot, Context& context) {
  CLI::App* verb = plot.add_subcommand("convergence",
                                       "How the misfit of fits fell, step by step\n"
                                       "  lobefit plot convergence callisto.json disney.json -o convergence.svg");
  verb->fallthrough();
  struct Arguments {
    std::vector<std::string> fits;
    std::string output, title = "Convergence";
    FigureSize size{900, 560};
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("FIT", a->fits, "Files of `lobefit fit`")->required();
  verb->add_option("--title", a->title, "Title")->capture_default_str();
  verb->add_option("--width", a->size.width, "Width in pixels")->check(CLI::Range(200, 8000))->capture_default_str();
  verb->add_option("--height", a->size.height, "Height in pixels")->check(CLI::Range(200, 8000))->capture_default_str();
  verb->add_option("-o,--output", a->output, "Figure to write, .svg or .png")->required();
  verb->callback(
      [&context, a] { write_figure(convergence_figure(a->fits, a->title), a->output, context.force, a->size); });
}

}  // namespace lobefit
