#include "fit/fit.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "fit/hops.h"
#include "fit/open_variables.h"
#include "fit/sample_entries.h"
#include "fit/starts.h"
#include "fit/table_problem.h"
#include "reference/json_reader.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

constexpr std::array<const char*, 3> channel_suffixes{".r", ".g", ".b"};

std::vector<FitMetric> all_metrics(const Table& table, std::span<const float> values,
                                   const std::vector<double>& weights) {
  const QuantityErrors errors = rms_differences(table, values, weights);
  std::vector<FitMetric> metrics;
  for (std::size_t q = 0; q < errors.size(); ++q) metrics.push_back({std::string(quantity_names[q]), errors[q]});
  return metrics;
}

void normalise(std::vector<double>& weights, const char* mend) {
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!(sum > 0.0)) throw Error(ExitCode::usage, "no entry is left", "--holdout", mend);
  for (double& weight : weights) weight /= sum;
}

/// A tint can't turn the sign of its intensity: products that can be negative keep to the side of their sum.
void keep_signs(LeastSquaresProblem& problem, const FitVariables& variables) {
  for (const std::size_t slot : variables.tint) {
    const auto first = static_cast<std::size_t>(variables.variable_of_slot[slot]);
    if (problem.lower[first] >= 0.0) continue;
    const double sum = problem.start[first] + problem.start[first + 1] + problem.start[first + 2];
    for (std::size_t v = first; v < first + 3; ++v) {
      (sum < 0.0 ? problem.upper : problem.lower)[v] = 0.0;
      problem.start[v] = std::clamp(problem.start[v], problem.lower[v], problem.upper[v]);
    }
  }
}

/// Whether a minimum turns the sign of a product within one colour.
bool breaks_signs(const Minimum& minimum, const FitVariables& variables) {
  return std::ranges::any_of(variables.tint, [&](std::size_t slot) {
    const auto first = minimum.x.begin() + variables.variable_of_slot[slot];
    const auto [least, most] = std::minmax_element(first, first + 3);
    return *least < 0.0 && *most > 0.0;
  });
}

/// Two minima of sorted ones: the first, and the next that is not the same once more.
void keep_best_two(std::vector<Minimum>& minima, const FitVariables& variables) {
  const Minimum& best = minima.front();
  const auto other = std::ranges::find_if(minima, [&](const Minimum& minimum) {
    for (std::size_t v = 0; v < variables.names.size(); ++v) {
      if (std::abs(minimum.x[v] - best.x[v]) > 0.05 * variables.range(v)) return true;
    }
    return false;
  });
  std::vector<Minimum> kept{best};
  if (other != minima.end()) kept.push_back(*other);
  minima = std::move(kept);
}

/// Problems over fewer and fewer entries that stand for the whole one.
struct Samples {
  TableProblem whole;
  std::optional<TableProblem> fine, coarse;
  std::vector<double> fine_weights;

  Samples(const Model& model, const ParameterValues& values, const Table& table, const FitOptions& options,
          const std::vector<double>& weights)
      : whole(model, values, table, options, weights), fine_weights(weights) {
    if ((options.starts <= 1 && !options.staged) || whole.entries() <= 2 * options.start_entries / 3) return;
    const EntrySampler sampler(table, weights, options.quantity);
    const auto sample = [&](std::optional<TableProblem>& problem, std::size_t count, std::uint64_t stream) {
      if (whole.entries() <= 2 * count) return;
      const std::vector<double> few = sampler.sample(count, options.seed + stream);
      problem.emplace(model, values, table, options, few);
      if (&problem == &fine) fine_weights = few;
    };
    sample(fine, options.start_entries, 1);
    sample(coarse, options.start_entries / 3, 2);
  }
  const TableProblem& fine_or_whole() const { return fine ? *fine : whole; }
  const TableProblem& coarse_or_fine() const { return coarse ? *coarse : fine_or_whole(); }
};

/// A start without a finite sum loses to any other.
bool is_better(const Minimum& a, const Minimum& b) {
  return a.sum_of_squares < b.sum_of_squares || (std::isfinite(a.sum_of_squares) && std::isnan(b.sum_of_squares));
}

std::vector<double> misfits_of(const std::vector<Minimum>& minima) {
  std::vector<double> misfits;
  for (const Minimum& minimum : minima) misfits.push_back(std::sqrt(minimum.sum_of_squares));
  return misfits;
}

/// Stage by stage from a guess over a coarse sample, the better half on over a finer one.
std::vector<Minimum> staged_minima(const Samples& samples, const ParameterValues& values, const Table& table,
                                   const FitOptions& options, double& misfit, std::vector<double>& start_misfits,
                                   Monitor& monitor) {
  const ParameterValues guessed = with_guess(values, guess_material(table, samples.fine_weights));
  std::vector<Minimum> minima(static_cast<std::size_t>(options.starts));
  tbb::parallel_for(std::size_t{0}, minima.size(), [&](std::size_t index) {
    minima[index] = staged_start(samples.coarse_or_fine(), guessed, options, static_cast<int>(index), monitor);
    monitor.advance(1);
  });
  start_misfits = misfits_of(minima);
  std::ranges::stable_sort(minima, is_better);
  minima.resize(std::max<std::size_t>(std::min<std::size_t>(minima.size(), 2), minima.size() / 2));
  misfit = std::sqrt(minima.front().sum_of_squares);
  const auto on_fine = [&](std::vector<double> start, int iterations, double tolerance) {
    LeastSquaresProblem next = samples.fine_or_whole().with_prior(std::move(start), options.prior * misfit);
    keep_signs(next, samples.whole.variables());
    next.maximum_iterations = iterations;
    next.tolerance = tolerance;
    return minimise(next, monitor);
  };
  tbb::parallel_for(std::size_t{0}, minima.size(),
                    [&](std::size_t index) { minima[index] = on_fine(minima[index].x, 60, 1e-5); });
  std::ranges::stable_sort(minima, is_better);
  if (options.hops) {
    misfit = std::sqrt(minima.front().sum_of_squares);
    minima.insert(minima.begin(), hop(samples.whole.variables(), values, minima.front(), options.seed,
                                      [&](std::vector<double> start) { return on_fine(std::move(start), 20, 1e-3); }));
  }
  misfit = std::sqrt(minima.front().sum_of_squares);
  return minima;
}

/// The best minimum of all starts.
Minimum search(const Samples& samples, const ParameterValues& values, const Table& table, const FitOptions& options,
               std::vector<double>& start_misfits, Monitor& monitor) {
  const FitVariables& variables = samples.whole.variables();
  const bool staged = options.staged && !variables.names.empty();
  double misfit = 0.0;
  const auto over_all = [&](std::vector<double> start) {
    LeastSquaresProblem whole = staged ? samples.whole.with_prior(std::move(start), options.prior * misfit)
                                       : samples.whole.problem(std::move(start));
    keep_signs(whole, variables);
    whole.tolerance = options.tolerance;
    return minimise(whole, monitor);
  };
  std::vector<Minimum> minima;
  if (staged) {
    minima = staged_minima(samples, values, table, options, misfit, start_misfits, monitor);
  } else {
    minima.resize(variables.names.empty() ? 1 : static_cast<std::size_t>(options.starts));
    tbb::parallel_for(std::size_t{0}, minima.size(), [&](std::size_t index) {
      LeastSquaresProblem start = samples.fine_or_whole().problem(
          index == 0 ? variables.start : sobol_start(variables, options.seed, static_cast<int>(index)));
      start.tolerance = samples.fine ? 1e-6 : options.tolerance;
      minima[index] = minimise(start, monitor);
      monitor.advance(1);
    });
    start_misfits = misfits_of(minima);
    std::ranges::stable_sort(minima, is_better);
  }
  if (staged || samples.fine || breaks_signs(minima.front(), variables)) {
    keep_best_two(minima, variables);
    for (Minimum& minimum : minima) minimum = over_all(minimum.x);
  }
  for (const ParameterValues& other : options.also_from) {
    minima.push_back(over_all(samples.whole.variables_of(other)));
    monitor.advance(1);
  }
  return *std::ranges::min_element(minima, is_better);
}

/// A parameter's derivatives by the solver's variables.
using Slopes = std::vector<std::pair<std::size_t, double>>;

double quadratic_form(const Slopes& a, const Slopes& b, const std::vector<std::vector<double>>& matrix) {
  double sum = 0.0;
  for (const auto& [i, slope_i] : a) {
    for (const auto& [j, slope_j] : b) sum += slope_i * slope_j * matrix[i][j];
  }
  return sum;
}

/// An estimate of `value` from those of the variables that it is made of.
FittedVariable combine(double value, const Slopes& by, const LeastSquaresSolution& solution) {
  if (by.size() == 1 && by.front().second == 1.0) return solution.variables[by.front().first];
  FittedVariable estimate{.value = value};
  if (!solution.inverse_normal.empty()) {
    estimate.misfit_standard_error =
        std::sqrt(std::max(0.0, solution.residual_variance * quadratic_form(by, by, solution.inverse_normal)));
  }
  if (!solution.covariance.empty())
    estimate.standard_error = std::sqrt(std::max(0.0, quadratic_form(by, by, solution.covariance)));
  estimate.ci_low = value - solution.quantile * estimate.standard_error;
  estimate.ci_high = value + solution.quantile * estimate.standard_error;
  estimate.at_bound = !by.empty() && solution.variables[by.front().first].at_bound;
  for (const auto& [variable, slope] : by)
    estimate.identifiable = estimate.identifiable && solution.variables[variable].identifiable;
  return estimate;
}

/// A product's three variables, and the largest of them, which stands for the intensity.
struct ProductVariables {
  std::size_t first, largest;
  double most;

  ProductVariables(std::size_t first_variable, const LeastSquaresSolution& solution)
      : first(first_variable), largest(0), most(0.0) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = solution.variables[first + c].value;
      if (std::abs(value) > std::abs(most)) {
        largest = c;
        most = value;
      }
    }
  }
};

/// The model's parameters and their errors, from the solver's variables and theirs.
void add_parameters(Fit& result, const TableProblem& problem, const LeastSquaresSolution& solution,
                    const ParameterValues& fitted, const TableModel& on_table) {
  const FitVariables& variables = problem.variables();
  const auto variable_at = [&](std::size_t slot) { return static_cast<std::size_t>(variables.variable_of_slot[slot]); };
  const auto product_of = [&](const std::vector<std::size_t>& slots, std::size_t offset) {
    const auto found = std::ranges::find(slots, offset);
    if (found == slots.end()) return std::optional<ProductVariables>();
    const std::size_t tint = variables.tint[static_cast<std::size_t>(found - slots.begin())];
    return std::optional(ProductVariables(variable_at(tint), solution));
  };
  std::vector<Slopes> slopes;
  for (const ParameterInfo& info : fitted.list()) {
    const auto offset = static_cast<std::size_t>(info.offset);
    if (info.file || on_table.set_by_axis(offset)) continue;
    const FitBounds bounds = bounds_of(info, result.options);
    const auto as_intensity = product_of(variables.intensity, offset), as_tint = product_of(variables.tint, offset);
    const bool grey =
        info.components == 1 ||
        (fitted.flat()[offset] == fitted.flat()[offset + 1] && fitted.flat()[offset] == fitted.flat()[offset + 2] &&
         variables.variable_of_slot[offset] == variables.variable_of_slot[offset + 1]);
    for (std::size_t c = 0; c < (grey ? 1u : 3u); ++c) {
      const double value = fitted.flat()[offset + c];
      FitParameter parameter{.name = std::string(info.name) + (grey ? "" : channel_suffixes[c]),
                             .estimate = {.value = value, .ci_low = value, .ci_high = value},
                             .lower = bounds.lower,
                             .upper = bounds.upper,
                             .free = as_intensity || variables.variable_of_slot[offset + c] >= 0};
      if (parameter.free) {
        Slopes by;
        if (as_intensity) {
          by = {{as_intensity->first + as_intensity->largest, 1.0}};
        } else if (!as_tint) {
          by = {{variable_at(offset + c), 1.0}};
        } else if (c != as_tint->largest && as_tint->most != 0.0) {
          by = {{as_tint->first + c, 1.0 / as_tint->most}, {as_tint->first + as_tint->largest, -value / as_tint->most}};
        }
        parameter.estimate = combine(value, by, solution);
        if (as_tint && as_tint->most == 0.0) parameter.estimate.identifiable = false;
        slopes.push_back(std::move(by));
      }
      result.parameters.push_back(std::move(parameter));
    }
  }
  result.solution = solution;
  result.solution.variables.clear();
  for (const FitParameter& p : result.parameters) {
    if (p.free) result.solution.variables.push_back(p.estimate);
  }
  std::vector<std::vector<double>>& correlation = result.solution.correlation;
  correlation.assign(slopes.size(), std::vector<double>(slopes.size(), 0.0));
  if (solution.inverse_normal.empty()) return;
  for (std::size_t k = 0; k < slopes.size(); ++k) {
    for (std::size_t l = 0; l < slopes.size(); ++l) {
      const double scale = quadratic_form(slopes[k], slopes[k], solution.inverse_normal) *
                           quadratic_form(slopes[l], slopes[l], solution.inverse_normal);
      if (scale > 0.0)
        correlation[k][l] = quadratic_form(slopes[k], slopes[l], solution.inverse_normal) / std::sqrt(scale);
    }
  }
}

/// Remarks that tell a parameter without effect what takes it away: "terminator_length has no effect while terminator
/// = 0". Found by trying: another value of one parameter, and the effect comes back.
void name_what_hides(Fit& result, const Model& model, const ParameterValues& fitted, const Table& table,
                     const FitOptions& options, const std::vector<double>& weights) {
  constexpr std::size_t few = 300;
  const std::vector<double> sample = EntrySampler(table, weights, options.quantity).sample(few, options.seed + 3);
  const auto effect_of = [&](const ParameterValues& values, const std::string& name) {
    FitOptions alone = options;
    alone.free = {name};
    const TableProblem problem(model, values, table, alone, sample);
    LeastSquaresProblem squares = problem.problem(problem.variables().start);
    std::vector<double> residuals(squares.residual_count), jacobian(residuals.size() * squares.names.size());
    squares.evaluate(squares.start, residuals, jacobian.data());
    return std::ranges::any_of(jacobian, [](double slope) { return std::abs(slope) > 1e-9; });
  };
  const TableModel on_table(model, fitted, table, options.mappings);
  for (const ParameterInfo& info : fitted.list()) {
    const std::string name(info.name);
    if (std::ranges::find(options.free, name) == options.free.end() || effect_of(fitted, name)) continue;
    std::vector<std::string> causes;
    for (const ParameterInfo& other : fitted.list()) {
      if (other.offset == info.offset || other.file || on_table.set_by_axis(static_cast<std::size_t>(other.offset)))
        continue;
      const std::span<const double> now = fitted.components(other);
      // An intensity's range is wide and its neutral value 1: values near both ends of [0, 4] try it.
      const double upper = std::min(other.upper, other.lower + 4.0);
      for (const double share : {0.15, 0.85}) {
        ParameterValues changed = fitted;
        const double value =
            other.choices.empty() ? other.lower + share * (upper - other.lower) : std::round(share * other.upper);
        changed.set(other.name, std::vector<double>(now.size(), value));
        if (!effect_of(changed, name)) continue;
        causes.push_back(fmt::format("{} = {:.4g}", other.name, now[0]));
        break;
      }
    }
    if (causes.empty()) continue;
    const std::string remark = name + " has no effect while " + fmt::format("{}", fmt::join(causes, " or "));
    std::erase_if(result.solution.remarks, [&](const std::string& text) {
      return text.find(name) != std::string::npos && text.find("has no effect on these data") != std::string::npos;
    });
    result.solution.remarks.push_back(remark);
  }
}

}  // namespace

std::vector<std::string> free_parameters(const ParameterValues& values, const Table& table,
                                         const std::vector<AxisMapping>& mappings, Tier tier) {
  const TableModel on_table(find_model(values.owner()), values, table, mappings);
  std::vector<std::string> names;
  for (const ParameterInfo& info : values.list()) {
    if (info.choices.empty() && info.tier <= tier && !on_table.set_by_axis(static_cast<std::size_t>(info.offset)))
      names.emplace_back(info.name);
  }
  return names;
}

HeldOut held_out_weights(const Table& table, const FitOptions& options) {
  HeldOut parts{.fitted = entry_weights(table, options.weights, options.quantity)};
  if (options.holdout <= 0.0) return parts;
  parts.held_out = parts.fitted;
  for (std::size_t entry = 0; entry < parts.fitted.size(); ++entry) {
    if (parts.fitted[entry] == 0.0) continue;
    const std::uint64_t stream =
        options.holdout_blocks ? static_cast<std::uint64_t>(direction_block(table.wi(entry), table.wo(entry))) : entry;
    const double u = SamplePoints(Sampler::philox, {options.seed, stream, own_stream})(0)[0];
    (u < options.holdout ? parts.fitted : parts.held_out)[entry] = 0.0;
  }
  normalise(parts.fitted, "hold out a smaller fraction");
  normalise(parts.held_out, "hold out a larger fraction, or none");
  return parts;
}

Fit fit(const Model& model, const ParameterValues& values, const Table& table, const FitOptions& options,
        Monitor& monitor) {
  const HeldOut parts = held_out_weights(table, options);
  std::vector<double> weights = parts.fitted;
  if (options.most_entries > 0)
    weights = EntrySampler(table, weights, options.quantity).sample(options.most_entries, options.seed);
  const Samples samples(model, values, table, options, weights);
  const TableProblem& problem = samples.whole;

  Fit result;
  result.model = std::string(model.info->name);
  result.options = options;
  result.mappings = options.mappings;
  result.entries = problem.entries();
  result.starts_tried = problem.variables().names.empty() ? 1 : options.starts;
  result.starts_tried += static_cast<int>(options.also_from.size());
  monitor.begin("fit " + result.model, static_cast<std::uint64_t>(result.starts_tried));
  const Minimum best = search(samples, values, table, options, result.start_misfits, monitor);
  monitor.end();
  // Where a misfit makes the intervals, a sample knows the curvature well enough; where noise does, the sample's own
  // would count.
  const bool sampled = samples.fine && options.intervals == Intervals::blocks;
  const LeastSquaresProblem whole = problem.problem(best.x, sampled ? &*samples.fine : nullptr);
  LeastSquaresSolution solution = analyse(whole, best);
  mark_open_variables(samples.fine_or_whole(), best.x, solution);

  const ParameterValues fitted = problem.values_at(best.x);
  const TableModel on_table(model, fitted, table, options.mappings);
  add_parameters(result, problem, solution, fitted, on_table);
  if (!result.solution.identifiable) name_what_hides(result, model, fitted, table, options, weights);
  const Table rendered = on_table.render();
  result.metrics = all_metrics(table, rendered.values, parts.fitted);
  if (!parts.held_out.empty()) result.holdout = all_metrics(table, rendered.values, parts.held_out);
  return result;
}

ParameterValues Fit::values() const {
  ParameterValues result = find_model(model).defaults();
  for (const FitParameter& parameter : parameters) {
    const std::size_t dot = parameter.name.find('.');
    const ParameterInfo& info = result.info(parameter.name.substr(0, dot));
    if (dot == std::string::npos) {
      result.set(info.name, parameter.estimate.value);
      continue;
    }
    const auto suffix = std::find(channel_suffixes.begin(), channel_suffixes.end(), parameter.name.substr(dot));
    if (info.components != 3 || suffix == channel_suffixes.end()) {
      throw Error(ExitCode::usage, "'" + parameter.name + "' is no channel of a colour", model,
                  "write NAME.r, NAME.g or NAME.b");
    }
    const std::span<const double> slots = result.components(info);
    std::vector<double> channels(slots.begin(), slots.end());
    channels[static_cast<std::size_t>(suffix - channel_suffixes.begin())] = parameter.estimate.value;
    result.set(info.name, channels);
  }
  return result;
}

Json metrics_json(const std::vector<FitMetric>& metrics) {
  Json json = Json::object();
  for (const FitMetric& metric : metrics) json[metric.name] = metric.value;
  return json;
}

Json estimate_json(const FitParameter& p) {
  return {{"value", p.estimate.value},
          {"stderr", p.estimate.standard_error},
          {"ci95", {p.estimate.ci_low, p.estimate.ci_high}},
          {"misfit_stderr", p.estimate.misfit_standard_error},
          {"lower", p.lower},
          {"upper", p.upper},
          {"at_bound", p.estimate.at_bound},
          {"identifiable", p.estimate.identifiable}};
}

Json Fit::json(const std::string& command, const std::string& table_sha256) const {
  Json list = Json::array();
  for (const FitParameter& p : parameters) {
    Json line{{"name", p.name}};
    line.update(estimate_json(p));
    line["free"] = p.free;
    list.push_back(std::move(line));
  }
  Json mapping_list = Json::array();
  for (const AxisMapping& m : mappings) {
    mapping_list.push_back({{"parameter", m.parameter}, {"axis", m.axis}, {"scale", m.scale}, {"power", m.power}});
  }
  Json document{
      {"model", model},
      {"params", list},
      {"metrics", metrics_json(metrics)},
      {"holdout", metrics_json(holdout)},
      {"correlation", solution.correlation},
      {"identifiable", solution.identifiable},
      {"remarks", solution.remarks},
      {"solver",
       {{"converged", solution.converged},
        {"iterations", solution.iterations},
        {"starts", starts_tried},
        {"start_misfits", start_misfits},
        {"history", solution.history},
        {"entries", entries},
        {"intervals", intervals_names[static_cast<std::size_t>(options.intervals)]},
        {"message", solution.termination},
        {"metric", quantity_names[static_cast<std::size_t>(options.quantity)]},
        {"weights", weight_names(options.weights)},
        {"loss", loss_names[static_cast<std::size_t>(options.loss)]}}},
      {"provenance",
       {{"version", LOBEFIT_VERSION}, {"command", command}, {"seed", options.seed}, {"table_sha256", table_sha256}}}};
  if (!mappings.empty()) document["map"] = mapping_list;
  return document;
}

namespace {

/// Throws unless it is square, a line per free parameter.
std::vector<std::vector<double>> correlation_of(const JsonReader& fit, const std::vector<FitParameter>& parameters) {
  const JsonReader list = fit.at("correlation");
  const auto free = static_cast<std::size_t>(std::ranges::count_if(parameters, &FitParameter::free));
  std::vector<std::vector<double>> lines;
  for (const JsonReader& line : list.elements()) lines.push_back(line.numbers());
  const bool square = std::ranges::all_of(lines, [&](const auto& line) { return line.size() == free; });
  if (lines.size() != free || !square) {
    throw list.error(fmt::format("{} parameters are free: expected as many lines and columns", free), "fit again");
  }
  return lines;
}

/// JSON has no infinity: null.
std::vector<double> numbers_or_infinity(const JsonReader& list) {
  std::vector<double> values;
  for (const JsonReader& element : list.elements())
    values.push_back(element.value().is_null() ? std::numeric_limits<double>::infinity() : element.number());
  return values;
}

}  // namespace

Fit Fit::from_json(const Json& json, const std::string& place) {
  const JsonReader reader(json, place);
  Fit result;
  result.model = reader.at("model").text();
  try {
    find_model(result.model);
    for (const JsonReader& element : reader.at("params").elements()) {
      FitParameter parameter{.name = element.at("name").text(),
                             .lower = element.at("lower").number(),
                             .upper = element.at("upper").number(),
                             .free = element.at("free").boolean()};
      parameter.estimate.value = element.at("value").number();
      parameter.estimate.standard_error = element.at("stderr").number();
      parameter.estimate.misfit_standard_error = element.at("misfit_stderr").number();
      const std::vector<double> interval = element.at("ci95").numbers();
      if (interval.size() != 2) throw element.at("ci95").error("expected two numbers", "write [low, high]");
      parameter.estimate.ci_low = interval[0];
      parameter.estimate.ci_high = interval[1];
      parameter.estimate.at_bound = element.at("at_bound").boolean();
      parameter.estimate.identifiable = !element.has("identifiable") || element.at("identifiable").boolean();
      result.parameters.push_back(parameter);
    }
    if (reader.has("correlation")) result.solution.correlation = correlation_of(reader, result.parameters);
    if (reader.has("solver")) {
      const JsonReader solver = reader.at("solver");
      if (solver.has("history")) result.solution.history = numbers_or_infinity(solver.at("history"));
      if (solver.has("start_misfits")) result.start_misfits = numbers_or_infinity(solver.at("start_misfits"));
    }
    if (reader.has("map")) {
      for (const JsonReader& m : reader.at("map").elements()) {
        result.mappings.push_back(
            {m.at("parameter").text(), m.at("axis").text(), m.at("scale").number(), m.at("power").number()});
      }
    }
    result.values();
  } catch (const Error& error) {
    if (error.code() == ExitCode::usage) throw error.inside(ExitCode::invalid_input, place);
    throw;
  }
  return result;
}

}  // namespace lobefit
