#include "fit/fit_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "reference/references.h"

namespace lobefit {

namespace {

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

Tier parse_tier(const std::string& name) {
  for (const Tier tier : {Tier::base, Tier::advanced, Tier::full}) {
    if (tier_name(tier) == name) return tier;
  }
  throw Error(ExitCode::usage, "unknown tier '" + name + "'", "--tier", "choose base, advanced or full");
}

/// What would be no fit at all.
void check_ranges(const FitSettings& settings) {
  const auto check = [](bool good, const char* option, const char* range) {
    if (!good) throw Error(ExitCode::usage, "out of range", option, std::string("choose ") + range);
  };
  check(settings.starts.value_or(1) >= 1 && settings.starts.value_or(1) <= 10000, "--starts", "from 1 to 10000");
  check(settings.holdout >= 0.0 && settings.holdout <= 0.9, "--holdout", "a fraction from 0 to 0.9");
  check(settings.prior >= 0.0 && settings.prior <= 10.0, "--prior", "from 0 to 10");
  check(settings.lobes == 1 || settings.lobes == 2, "--lobes", "1 or 2");
  check(settings.intervals.empty() || std::ranges::find(intervals_names, settings.intervals) != intervals_names.end(),
        "--intervals", "data or blocks");
}

/// Which parameters are free, and the values of the others.
std::vector<std::string> choose_free(const FitSettings& settings, const Table& table, const FitOptions& options,
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
  const std::vector<std::string> fixed = names_of(settings.fix);
  std::vector<std::string> free = names_of(settings.free);
  if (settings.free.empty()) {
    const bool from_reference = find_reference_or_null(table.model) != nullptr;
    for (const std::string& name : free_parameters(values, table, options.mappings, parse_tier(settings.tier))) {
      // What the reference's own settings say is known, not fitted.
      if (from_reference && table.parameters.contains(name)) continue;
      if (settings.lobes == 1 && name.starts_with("dual_specular")) continue;
      // In one channel, a tint is no more than another intensity.
      if (table.channels == 1 && name.ends_with("_tint")) continue;
      free.push_back(name);
    }
  }
  for (const std::string& name : fixed) {
    if (!settings.free.empty() && std::find(free.begin(), free.end(), name) != free.end()) {
      throw Error(ExitCode::usage, "parameter '" + name + "' is both free and fixed", "fit",
                  "drop it from one of them");
    }
    std::erase(free, name);
  }
  return free;
}

/// "alpha=0.01,0.5" → bounds of alpha.
FitBounds parse_bounds(const std::string& text, const ParameterValues& values) {
  const std::size_t equals = text.find('='), comma = text.find(',', equals == std::string::npos ? 0 : equals);
  if (equals == std::string::npos || comma == std::string::npos)
    throw Error(ExitCode::usage, "no bounds in '" + text + "'", "--bound", "write NAME=LOWER,UPPER");
  const ParameterInfo& info = values.info(text.substr(0, equals));
  const FitBounds bounds{std::string(info.name), parse_number(text.substr(equals + 1, comma - equals - 1), "--bound"),
                         parse_number(text.substr(comma + 1), "--bound")};
  if (!(bounds.lower >= info.lower && bounds.upper <= info.upper && bounds.lower < bounds.upper)) {
    throw Error(ExitCode::usage, "bounds of " + bounds.name + " must lie in its range, the lower below the upper",
                "--bound", fmt::format("choose them from {:g} to {:g}", info.lower, info.upper));
  }
  return bounds;
}

/// Bounds as given. Above .95 a falloff does not fall off: it makes its intensity a second albedo everywhere but in the
/// very mirror direction, where measurements say least; so staged fits stop there unless told otherwise.
std::vector<FitBounds> choose_bounds(const FitSettings& settings, bool staged, const ParameterValues& values) {
  std::vector<FitBounds> bounds;
  for (const std::string& text : settings.bounds) bounds.push_back(parse_bounds(text, values));
  for (const char* name : {"diffuse_fresnel_falloff", "retroreflection_falloff"}) {
    if (staged && values.has(name) && std::ranges::find(bounds, name, &FitBounds::name) == bounds.end())
      bounds.push_back({name, 0.0, 0.95});
  }
  return bounds;
}

/// Whether a file holds a dense isotropic measurement, which fits take on a grid of angles.
bool is_dense_measurement(const BrdfFile& file) {
  if (file.table.coordinates == Coordinates::rusinkiewicz) return true;
  return file.rgl && file.rgl->isotropic();
}

FitOptions options_of(const FitSettings& settings, const FitTable& table, std::uint64_t seed) {
  const bool measured = table.dense;
  FitOptions options;
  options.quantity = parse_quantity(settings.metric);
  options.weights = table.weights;
  parse_loss(settings.loss, options);
  for (const std::string& text : settings.mappings) options.mappings.push_back(AxisMapping::parse(text));
  options.staged = settings.staged || (measured && !settings.not_staged);
  options.starts = settings.starts.value_or(measured ? 6 : 1);
  options.most_entries = settings.directions.value_or(measured ? 50000 : 0);
  options.prior = settings.prior;
  options.hops = settings.hops;
  // A measured BRDF is no closer to its fit than a few per cent: further digits are of no use.
  options.tolerance = options.staged ? 1e-3 : options.tolerance;
  options.holdout = settings.holdout;
  options.holdout_blocks = measured;
  options.intervals = settings.intervals.empty() ? (measured ? Intervals::blocks : Intervals::data)
                                                 : static_cast<Intervals>(settings.intervals == "blocks");
  options.seed = seed;
  return options;
}

/// A lobe narrower than what the grid sees of it rests on a handful of entries.
void warn_of_sharp_lobes(Fit& fit, const Table& table) {
  if (table.coordinates != Coordinates::spherical || table.grid.phi.size() < 2) return;
  const auto alpha = std::ranges::find(fit.parameters, "alpha", &FitParameter::name);
  if (alpha == fit.parameters.end() || !alpha->free) return;
  // The half vector of directions that lie as close to the mirror direction as the azimuths allow.
  const auto nearest =
      std::ranges::min_element(table.grid.phi.values, {}, [](double phi) { return std::abs(180.0 - phi); });
  const double finest = std::tan(
      radians(0.5 * std::max(0.5 * (table.grid.phi.values[1] - table.grid.phi.values[0]), std::abs(180.0 - *nearest))));
  if (alpha->estimate.value >= finest) return;
  fit.solution.remarks.push_back(fmt::format(
      "alpha is finer than the grid, which sees half vectors from {:.2g} degrees on: hold it by --bound alpha={:.2g},1 "
      "if a highlight that narrow is not wanted",
      degrees(std::atan(finest)), finest));
}

}  // namespace

FitTable fit_table(BrdfFile file, const std::string& grid, const std::string& weights) {
  FitTable taken{.file = std::move(file), .grid = grid};
  taken.dense = is_dense_measurement(taken.file);
  if (grid == "auto") taken.grid = taken.dense ? "measured" : "native";
  if (taken.grid != "native") taken.file.table = taken.file.resampled(Grid::named_or_file(taken.grid), true);
  taken.weights = parse_weights(!weights.empty() ? weights : taken.dense ? "sin_theta_i,sin_theta_o" : "uniform");
  return taken;
}

TableFit fit_as_set(const FitSettings& settings, const FitTable& taken, std::uint64_t seed, Monitor& monitor) {
  check_ranges(settings);
  const Table& table = taken.file.table;
  TableFit result;
  FitOptions options = options_of(settings, taken, seed);
  ParameterValues values = with_table_parameters(settings.model->defaults(), table);
  options.free = choose_free(settings, table, options, values);
  options.bounds = choose_bounds(settings, options.staged, values);
  if (settings.compare_tiers) {
    result.tiers = fit_tiers(*settings.model, values, table, options, parse_tier(settings.tier), monitor);
    if (result.tiers.empty()) {
      throw Error(ExitCode::usage, "no parameter is free, so there are no tiers", "--compare-tiers",
                  "free parameters, or leave it out");
    }
    result.fit = result.tiers.back().fit;
  } else {
    result.fit = fit(*settings.model, values, table, options, monitor);
  }
  warn_of_sharp_lobes(result.fit, table);
  return result;
}

}  // namespace lobefit
