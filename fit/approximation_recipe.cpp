#include "fit/approximation_recipe.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <numeric>

#include "fit/least_squares.h"
#include "fit/recipe_reading.h"
#include "reference/output_file.h"
#include "reference/quiet_monitor.h"

namespace lobefit {

namespace {

// ---- reading -------------------------------------------------------------------------------------------------------

std::vector<std::string> argument_names(const Target& target) {
  std::vector<std::string> names;
  for (const ParameterInfo& info : target.arguments) names.emplace_back(info.name);
  return names;
}

const ParameterInfo& find_argument(const Target& target, const JsonReader& place, const std::string& name) {
  const int index = target.find(name);
  if (index < 0) {
    throw place.error(fmt::format("{} has no argument '{}'", target.name, name),
                      fmt::format("choose among {}", fmt::join(argument_names(target), ", ")));
  }
  return target.arguments[static_cast<std::size_t>(index)];
}

double in_range(const JsonReader& place, const ParameterInfo& info, double value) {
  // Cosines of degrees come out a rounding beyond.
  if (!(value >= info.lower - 1e-12 && value <= info.upper + 1e-12)) {
    throw place.error(fmt::format("{} = {:g} is out of range", info.name, value),
                      fmt::format("choose from {:g} to {:g}", info.lower, info.upper));
  }
  return std::clamp(value, info.lower, info.upper);
}

DomainAxis read_axis(const JsonReader& reader, const ParameterInfo& info) {
  DomainAxis axis{.argument = std::string(info.name)};
  std::string as;
  if (reader.value().is_array()) {
    axis.given = reader.numbers();
  } else {
    reader.allow({"from", "to", "count", "values", "as"});
    if (reader.has("as")) as = reader.at("as").text();
    if (!as.empty() && as != "cosine_of_degrees" && as != "sine_of_degrees") {
      throw reader.at("as").error("unknown reading '" + as + "'", "write cosine_of_degrees or sine_of_degrees");
    }
    if (reader.has("values")) {
      axis.given = reader.at("values").numbers();
    } else {
      const double from = reader.at("from").number(), to = reader.at("to").number(), n = reader.at("count").number();
      if (!(n >= 1.0 && n <= 1e5) || n != std::floor(n)) {
        throw reader.at("count").error("an empty domain", "give a whole number of points, 1 or more");
      }
      for (int i = 0; i < static_cast<int>(n); ++i)
        axis.given.push_back(n > 1.0 ? lerp(from, to, i / (n - 1.0)) : from);
    }
  }
  axis.degrees = !as.empty();
  for (const double given : axis.given) {
    const double value = as.empty()                ? given
                         : as == "sine_of_degrees" ? std::sin(given * pi / 180.0)
                                                   : std::cos(given * pi / 180.0);
    axis.values.push_back(in_range(reader, info, value));
  }
  return axis;
}

FormDomain read_domain(const JsonReader& reader, const Target& target, std::string label) {
  FormDomain domain{.label = std::move(label), .axes = {}};
  for (const auto& [name, member] : reader.members()) {
    domain.axes.push_back(read_axis(member, find_argument(target, member, name)));
  }
  if (domain.axes.empty()) throw reader.error("an empty domain", "name at least one argument of the target");
  return domain;
}

/// A number in quotes keeps its digits: "1.19" is known to half a unit of the last.
PublishedConstant read_published(const JsonReader& reader) {
  if (!reader.value().is_string()) return {reader.number(), 0.0};
  const std::string text = reader.text();
  std::size_t used = 0;
  double value = 0.0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
  }
  if (used == 0 || used != text.size()) throw reader.error("'" + text + "' is no number", "write it as it is printed");
  const std::size_t point = text.find('.');
  const double decimals = point == std::string::npos ? 0.0 : static_cast<double>(text.size() - point - 1);
  return {value, 0.5 * std::pow(10.0, -decimals)};
}

template <std::size_t n>
std::size_t read_choice(const JsonReader& reader, const std::array<std::string_view, n>& names) {
  const auto found = std::find(names.begin(), names.end(), reader.text());
  if (found == names.end()) {
    throw reader.error("unknown choice '" + reader.text() + "'", fmt::format("write {}", fmt::join(names, " or ")));
  }
  return static_cast<std::size_t>(found - names.begin());
}

/// A form stands for a target whose arguments it has.
const Form& read_form(const JsonReader& reader, const Target& target) {
  const Form& form = *in_file(reader, [&] { return &find_form(reader.text()); });
  std::vector<std::string> known = argument_names(target);
  known.insert(known.end(), target.derived_names.begin(), target.derived_names.end());
  for (const std::string& argument : form.arguments) {
    if (std::find(known.begin(), known.end(), argument) == known.end()) {
      throw reader.error(fmt::format("{} needs '{}', which {} has not", form.name, argument, target.name),
                         fmt::format("choose a form of {}", fmt::join(known, ", ")));
    }
  }
  return form;
}

ApproximationRow read_row(const JsonReader& reader) {
  reader.allow({"name", "note", "form", "target", "set", "each", "domain", "other_domains", "metric", "norm", "free",
                "published", "rivals", "integral"});
  ApproximationRow row;
  row.name = reader.at("name").text();
  if (reader.has("note")) row.note = reader.at("note").text();
  const JsonReader target = reader.at("target");
  row.target = in_file(target, [&] { return &find_target(target.text()); });
  row.form = &read_form(reader.at("form"), *row.target);
  for (const ParameterInfo& info : row.target->arguments) row.target_values.push_back(info.initial);
  if (reader.has("set")) {
    for (const auto& [name, member] : reader.at("set").members()) {
      const ParameterInfo& info = find_argument(*row.target, member, name);
      row.target_values[static_cast<std::size_t>(row.target->find(name))] = in_range(member, info, member.number());
    }
  }
  if (reader.has("each")) {
    const auto members = reader.at("each").members();
    if (members.size() != 1) throw reader.at("each").error("expected one argument", "write {\"ior\": [1.3, 1.5]}");
    const ParameterInfo& info = find_argument(*row.target, members[0].second, members[0].first);
    row.each = members[0].first;
    row.each_values = members[0].second.numbers();
    for (const double value : row.each_values) in_range(members[0].second, info, value);
  }
  row.domain = read_domain(reader.at("domain"), *row.target, "");
  if (reader.has("other_domains")) {
    for (const auto& [label, member] : reader.at("other_domains").members()) {
      row.other_domains.push_back(read_domain(member, *row.target, label));
    }
  }
  if (reader.has("metric")) row.metric = static_cast<FormMetric>(read_choice(reader.at("metric"), form_metric_names));
  if (reader.has("norm")) row.norm = static_cast<FormNorm>(read_choice(reader.at("norm"), form_norm_names));
  for (const FormConstant& constant : row.form->constants) row.published.push_back({constant.initial, 0.0});
  row.has_published = reader.has("published");
  if (row.has_published) {
    for (const auto& [name, member] : reader.at("published").members()) {
      const std::size_t k = in_file(member, [&, &name = name] { return row.form->constant_index(name); });
      row.published[k] = read_published(member);
      const FormConstant& constant = row.form->constants[k];
      if (!(row.published[k].value >= constant.lower && row.published[k].value <= constant.upper)) {
        throw member.error(fmt::format("{} is out of range", row.published[k].value),
                           fmt::format("choose from {:g} to {:g}", constant.lower, constant.upper));
      }
    }
  }
  for (const JsonReader& name : reader.at("free").elements()) {
    row.free.push_back(in_file(name, [&] { return row.form->constant_index(name.text()); }));
  }
  if (reader.has("rivals")) {
    for (const JsonReader& rival : reader.at("rivals").elements()) {
      row.rivals.push_back(&read_form(rival, *row.target));
    }
  }
  if (reader.has("integral")) {
    row.integral = reader.at("integral").text();
    find_argument(*row.target, reader.at("integral"), row.integral);
  }
  return row;
}

// ---- points and errors
// -----------------------------------------------------------------------------------------------

/// The domain with the target's values.
struct Sampled {
  std::vector<std::vector<double>> arguments;  // of the form
  std::vector<double> truth;
  std::vector<std::size_t> block;  // along the first axis, of ten

  static constexpr std::size_t block_count = 10;
};

Sampled sample(const ApproximationRow& row, const FormDomain& domain, double each_value) {
  const std::vector<std::vector<double>> points = domain_points(row, domain, each_value);
  Sampled sampled;
  sampled.arguments.resize(points.size());
  sampled.truth.resize(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    sampled.arguments[i] = form_arguments(*row.form, *row.target, points[i]);
    sampled.truth[i] = row.target->evaluate(points[i]);
  });
  const std::size_t first = domain.axes.front().values.size(), rest = points.size() / first;
  for (std::size_t i = 0; i < points.size(); ++i) {
    sampled.block.push_back(i / rest * Sampled::block_count / std::max(first, Sampled::block_count));
  }
  // Relative errors of what is next to nothing mean nothing.
  if (row.metric == FormMetric::relative) {
    double largest = 0.0;
    for (const double truth : sampled.truth) largest = std::max(largest, std::abs(truth));
    for (std::size_t i = points.size(); i-- > 0;) {
      if (std::abs(sampled.truth[i]) > 1e-6 * largest) continue;
      sampled.arguments.erase(sampled.arguments.begin() + static_cast<std::ptrdiff_t>(i));
      sampled.truth.erase(sampled.truth.begin() + static_cast<std::ptrdiff_t>(i));
      sampled.block.erase(sampled.block.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
  return sampled;
}

double error_scale(FormMetric metric, double truth) { return metric == FormMetric::relative ? 1.0 / truth : 1.0; }

FormScore score(const Form& form, std::span<const double> constants, const Sampled& sampled, FormMetric metric) {
  FormScore result;
  for (std::size_t i = 0; i < sampled.truth.size(); ++i) {
    const double error = (form.evaluate(constants, sampled.arguments[i], nullptr) - sampled.truth[i]) *
                         error_scale(metric, sampled.truth[i]);
    result.rms += error * error;
    result.max = std::max(result.max, std::abs(error));
  }
  result.rms = std::sqrt(result.rms / static_cast<double>(sampled.truth.size()));
  return result;
}

// ---- fitting
// ---------------------------------------------------------------------------------------------------------

/// Σ |error/unit|^power as least squares, over the points outside a block.
LeastSquaresProblem problem_of(const ApproximationRow& row, const Sampled& sampled, FormMetric metric,
                               std::span<const double> all, double power, double unit, std::size_t without) {
  std::vector<std::size_t> points;
  for (std::size_t i = 0; i < sampled.truth.size(); ++i) {
    if (sampled.block[i] != without) points.push_back(i);
  }
  LeastSquaresProblem problem;
  problem.residual_count = points.size();
  for (const std::size_t k : row.free) {
    const FormConstant& constant = row.form->constants[k];
    problem.names.emplace_back(constant.name);
    problem.start.push_back(all[k]);
    problem.lower.push_back(constant.lower);
    problem.upper.push_back(constant.upper);
  }
  problem.evaluate = [&row, &sampled, metric, power, unit, points, constants = std::vector(all.begin(), all.end())](
                         std::span<const double> x, std::span<double> residuals, double* jacobian) mutable {
    for (std::size_t k = 0; k < row.free.size(); ++k) constants[row.free[k]] = x[k];
    std::vector<double> derivatives(constants.size());
    for (std::size_t r = 0; r < points.size(); ++r) {
      const std::size_t i = points[r];
      const double scale = error_scale(metric, sampled.truth[i]) / unit;
      const double value = row.form->evaluate(constants, sampled.arguments[i], jacobian ? derivatives.data() : nullptr);
      const double error = (value - sampled.truth[i]) * scale;
      const double bent = std::pow(std::abs(error), 0.5 * power - 1.0);
      residuals[r] = error * bent;
      if (!std::isfinite(residuals[r])) return false;
      for (std::size_t k = 0; jacobian && k < row.free.size(); ++k) {
        jacobian[r * row.free.size() + k] = 0.5 * power * bent * derivatives[row.free[k]] * scale;
      }
    }
    return true;
  };
  return problem;
}

std::vector<double> minimum(const ApproximationRow& row, const LeastSquaresProblem& problem, std::vector<double> all,
                            Monitor& monitor) {
  const Minimum found = minimise(problem, monitor);
  for (std::size_t k = 0; k < row.free.size(); ++k) all[row.free[k]] = found.x[k];
  return all;
}

constexpr std::size_t no_block = ~std::size_t{0};

/// The best constants under a metric and a norm.
std::vector<double> refit(const ApproximationRow& row, const Sampled& sampled, FormMetric metric, FormNorm norm,
                          const std::vector<double>& start, std::size_t without, Monitor& monitor) {
  if (row.free.empty()) return start;
  std::vector<double> best = minimum(row, problem_of(row, sampled, metric, start, 2.0, 1.0, without), start, monitor);
  if (norm == FormNorm::rms) return best;
  std::vector<double> now = best;
  for (const double power : {4.0, 8.0, 16.0, 32.0, 64.0, 128.0}) {
    const double unit = score(*row.form, now, sampled, metric).max;
    if (unit <= 0.0) break;
    now = minimum(row, problem_of(row, sampled, metric, now, power, unit, without), now, monitor);
    if (score(*row.form, now, sampled, metric).max < score(*row.form, best, sampled, metric).max) best = now;
  }
  return best;
}

void set_intervals(ApproximationFit& fit, const ApproximationRow& row, const Sampled& sampled, Monitor& monitor) {
  const std::vector<double> values = fit.values();
  std::vector<std::size_t> blocks(sampled.block);
  std::sort(blocks.begin(), blocks.end());
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  const auto count = static_cast<double>(blocks.size());
  if (blocks.size() < 3) return;
  std::vector<std::vector<double>> without;
  for (const std::size_t block : blocks) {
    without.push_back(refit(row, sampled, row.metric, row.norm, values, block, monitor));
  }
  const double quantile = boost::math::quantile(boost::math::students_t(count - 1.0), 0.975);
  for (const std::size_t k : row.free) {
    double mean = 0.0, squares = 0.0;
    for (const auto& one : without) mean += one[k] / count;
    for (const auto& one : without) squares += (one[k] - mean) * (one[k] - mean);
    RefittedConstant& constant = fit.constants[k];
    constant.standard_error = std::sqrt((count - 1.0) / count * squares);
    constant.ci_low = constant.value - quantile * constant.standard_error;
    constant.ci_high = constant.value + quantile * constant.standard_error;
  }
}

std::vector<FormReading> read_published_as(const ApproximationRow& row, const std::vector<double>& published,
                                           double each_value, Monitor& monitor) {
  std::vector<const FormDomain*> domains{&row.domain};
  for (const FormDomain& other : row.other_domains) domains.push_back(&other);
  std::vector<FormReading> readings;
  for (const FormDomain* domain : domains) {
    for (const FormMetric metric : {FormMetric::absolute, FormMetric::relative}) {
      ApproximationRow as = row;
      as.metric = metric;
      const Sampled sampled = sample(as, *domain, each_value);
      for (const FormNorm norm : {FormNorm::rms, FormNorm::max}) {
        FormReading reading{domain->label, metric, norm, {}, 0.0, true};
        reading.constants = refit(row, sampled, metric, norm, published, no_block, monitor);
        for (const std::size_t k : row.free) {
          const double difference = std::abs(reading.constants[k] - published[k]);
          reading.distance = std::max(reading.distance, difference / std::max(std::abs(published[k]), 1e-12));
          reading.meets_published =
              reading.meets_published && difference <= std::max(row.published[k].digit, 1e-6 * std::abs(published[k]));
        }
        readings.push_back(std::move(reading));
      }
    }
  }
  std::stable_sort(readings.begin(), readings.end(),
                   [](const FormReading& a, const FormReading& b) { return a.distance < b.distance; });
  return readings;
}

/// 2 ∫ f dφ over [0, π] by trapezes, which converge fast for what is periodic.
ApproximationFit::Integral integrate(const ApproximationRow& row, const std::vector<double>& published,
                                     const std::vector<double>& refitted, double each_value) {
  constexpr int steps = 2000;
  FormDomain circle{.label = "", .axes = {{.argument = row.integral, .values = {}, .given = {}}}};
  for (int i = 0; i <= steps; ++i) circle.axes[0].values.push_back(std::cos(pi * i / steps));
  ApproximationFit::Integral sum{0.0, 0.0, 0.0};
  const std::vector<std::vector<double>> points = domain_points(row, circle, each_value);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double weight = 2.0 * pi / steps * (i == 0 || i + 1 == points.size() ? 0.5 : 1.0);
    const std::vector<double> x = form_arguments(*row.form, *row.target, points[i]);
    sum.target += weight * row.target->evaluate(points[i]);
    sum.published += weight * row.form->evaluate(published, x, nullptr);
    sum.refit += weight * row.form->evaluate(refitted, x, nullptr);
  }
  return sum;
}

ApproximationFit fit_row(const ApproximationRow& row, double each_value, Monitor& monitor) {
  ApproximationFit fit{.row = &row, .each_value = each_value};
  const std::vector<double> published = row.published_values();
  const Sampled sampled = sample(row, row.domain, each_value);
  const std::vector<double> values = refit(row, sampled, row.metric, row.norm, published, no_block, monitor);
  for (const double value : values) fit.constants.push_back({.value = value, .ci_low = value, .ci_high = value});
  if (!row.free.empty()) {
    const LeastSquaresProblem problem = problem_of(row, sampled, row.metric, values, 2.0, 1.0, no_block);
    Minimum at;
    for (const std::size_t k : row.free) at.x.push_back(values[k]);
    const LeastSquaresSolution solution = analyse(problem, at);
    for (std::size_t k = 0; k < row.free.size(); ++k) {
      RefittedConstant& constant = fit.constants[row.free[k]];
      constant.free = true;
      constant.at_bound = solution.variables[k].at_bound;
      constant.identifiable = solution.variables[k].identifiable;
    }
    set_intervals(fit, row, sampled, monitor);
  }
  fit.published = score(*row.form, published, sampled, row.metric);
  fit.refit = score(*row.form, values, sampled, row.metric);
  for (const Form* rival : row.rivals) {
    ApproximationRow as = row;
    as.form = rival;
    fit.rivals.push_back(score(*rival, rival->published(), sample(as, row.domain, each_value), row.metric));
  }
  if (row.has_published && !row.free.empty()) fit.readings = read_published_as(row, published, each_value, monitor);
  if (!row.integral.empty()) fit.integral = integrate(row, published, values, each_value);
  return fit;
}

std::string reading_text(const FormReading& reading) {
  return fmt::format("{}{} error{}", reading.norm == FormNorm::rms ? "rms " : "largest ",
                     form_metric_names[static_cast<std::size_t>(reading.metric)],
                     reading.domain.empty() ? "" : ", " + reading.domain);
}

/// Of rows that are fitted once: which readings give their published constants.
std::string conclusion_of(const std::vector<ApproximationFit>& fits) {
  std::string found, missed;
  for (const ApproximationFit& fit : fits) {
    if (!fit.row->each.empty() || fit.readings.empty()) continue;
    const auto meets = std::ranges::find(fit.readings, true, &FormReading::meets_published);
    if (meets != fit.readings.end()) {
      found += fmt::format("{}{} ({})", found.empty() ? "" : ", ", fit.row->name, reading_text(*meets));
    } else {
      missed += fmt::format("{}{} ({:.2g} % off)", missed.empty() ? "" : ", ", fit.row->name,
                            100.0 * fit.readings.front().distance);
    }
  }
  std::string text;
  if (!found.empty()) text = "The published constants are the best by some reading in " + found + ".";
  if (!missed.empty()) text += (text.empty() ? "" : " ") + ("By none that was tried in " + missed + ".");
  return text;
}

}  // namespace

std::vector<double> ApproximationRow::published_values() const {
  std::vector<double> values;
  for (const PublishedConstant& constant : published) values.push_back(constant.value);
  return values;
}

std::vector<double> ApproximationFit::values() const {
  std::vector<double> result;
  for (const RefittedConstant& constant : constants) result.push_back(constant.value);
  return result;
}

std::vector<std::vector<double>> domain_points(const ApproximationRow& row, const FormDomain& domain,
                                               double each_value) {
  std::vector<double> fixed = row.target_values;
  if (!row.each.empty()) fixed[static_cast<std::size_t>(row.target->find(row.each))] = each_value;
  std::vector<std::vector<double>> points{fixed};
  for (const DomainAxis& axis : domain.axes) {
    const auto slot = static_cast<std::size_t>(row.target->find(axis.argument));
    std::vector<std::vector<double>> next;
    for (const std::vector<double>& point : points) {
      for (const double value : axis.values) {
        next.push_back(point);
        next.back()[slot] = value;
      }
    }
    points = std::move(next);
  }
  return points;
}

std::vector<double> form_arguments(const Form& form, const Target& target, const std::vector<double>& point) {
  const std::vector<double> derived = target.derive ? target.derive(point) : std::vector<double>{};
  std::vector<double> arguments;
  for (const std::string& name : form.arguments) {
    const int own = target.find(name);
    if (own >= 0) {
      arguments.push_back(point[static_cast<std::size_t>(own)]);
    } else {
      const auto found = std::find(target.derived_names.begin(), target.derived_names.end(), name);
      arguments.push_back(derived[static_cast<std::size_t>(found - target.derived_names.begin())]);
    }
  }
  return arguments;
}

ApproximationRecipe ApproximationRecipe::read(const std::filesystem::path& path) {
  const Json json = parse_json(read_file(path), path.string());
  const JsonReader reader(json, path.string());
  return naming_file(path, [&] {
    reader.allow({"$schema", "recipe", "kind", "title", "description", "rows"});
    ApproximationRecipe recipe;
    recipe.name = reader.at("recipe").text();
    recipe.title = reader.at("title").text();
    recipe.description = reader.at("description").text();
    for (const JsonReader& row : reader.at("rows").elements()) recipe.rows.push_back(read_row(row));
    if (recipe.rows.empty()) throw reader.at("rows").error("no rows", "add one");
    return recipe;
  });
}

ApproximationResult run_approximations(const ApproximationRecipe& recipe, Monitor& monitor) {
  ApproximationResult result;
  std::size_t steps = 0;
  for (const ApproximationRow& row : recipe.rows) steps += row.each_values.size();
  monitor.begin("refit " + recipe.name, steps);
  QuietMonitor quiet(monitor);
  for (const ApproximationRow& row : recipe.rows) {
    for (const double each_value : row.each_values) {
      result.fits.push_back(fit_row(row, each_value, quiet));
      monitor.check();
      monitor.advance(1);
    }
  }
  monitor.end();
  result.conclusion = conclusion_of(result.fits);
  return result;
}

Json ApproximationResult::json(const ApproximationRecipe& recipe, const std::string& command) const {
  Json rows = Json::array();
  for (const ApproximationFit& fit : fits) {
    const ApproximationRow& row = *fit.row;
    Json domain = Json::object();
    for (const DomainAxis& axis : row.domain.axes) {
      domain[axis.argument] = {{axis.degrees ? "degrees" : "values", axis.given}};
    }
    domain["metric"] = form_metric_names[static_cast<std::size_t>(row.metric)];
    domain["norm"] = form_norm_names[static_cast<std::size_t>(row.norm)];
    Json reference{{"name", row.target->name}};
    for (std::size_t i = 0; i < row.target->arguments.size(); ++i) {
      const std::string name(row.target->arguments[i].name);
      const bool varies = std::any_of(row.domain.axes.begin(), row.domain.axes.end(),
                                      [&](const DomainAxis& axis) { return axis.argument == name; });
      if (!varies) reference[name] = name == row.each ? fit.each_value : row.target_values[i];
    }
    Json params = Json::object(), fixed = Json::array(), free = Json::array(), published = Json::object();
    bool identifiable = true;
    for (std::size_t k = 0; k < fit.constants.size(); ++k) {
      const RefittedConstant& constant = fit.constants[k];
      const std::string name(row.form->constants[k].name);
      params[name] = {{"value", constant.value}};
      if (constant.free) {
        params[name].update({{"stderr", constant.standard_error},
                             {"ci95", {constant.ci_low, constant.ci_high}},
                             {"at_bound", constant.at_bound},
                             {"identifiable", constant.identifiable}});
      }
      (constant.free ? free : fixed).push_back(name);
      if (row.has_published) published[name] = row.published[k].value;
      identifiable = identifiable && constant.identifiable;
    }
    Json rms{{"published", fit.published.rms}, {"refit", fit.refit.rms}};
    Json largest{{"published", fit.published.max}, {"refit", fit.refit.max}};
    for (std::size_t r = 0; r < fit.rivals.size(); ++r) {
      rms[std::string(row.rivals[r]->name)] = fit.rivals[r].rms;
      largest[std::string(row.rivals[r]->name)] = fit.rivals[r].max;
    }
    Json readings = Json::array();
    for (const FormReading& reading : fit.readings) {
      Json constants = Json::object();
      for (const std::size_t k : row.free) constants[std::string(row.form->constants[k].name)] = reading.constants[k];
      readings.push_back({{"domain", reading.domain},
                          {"metric", form_metric_names[static_cast<std::size_t>(reading.metric)]},
                          {"norm", form_norm_names[static_cast<std::size_t>(reading.norm)]},
                          {"params", constants},
                          {"distance", reading.distance},
                          {"meets_published", reading.meets_published}});
    }
    Json line{{"name", row.name},
              {"model", row.form->name},
              {"formula", row.form->formula},
              {"reference", reference},
              {"domain", domain},
              {"method", "exact"},
              {"free", free},
              {"fixed", fixed},
              {"published", published},
              {"params", params},
              {"rms", rms},
              {"max", largest},
              {"readings", readings},
              {"identifiable", identifiable}};
    if (!row.each.empty()) line["each"] = row.each;
    if (fit.integral) {
      line["integral"] = {{"over", row.integral},
                          {"target", fit.integral->target},
                          {"published", fit.integral->published},
                          {"refit", fit.integral->refit}};
    }
    rows.push_back(std::move(line));
  }
  return {{"recipe", recipe.name},
          {"title", recipe.title},
          {"description", recipe.description},
          {"rows", rows},
          {"conclusion", conclusion},
          {"provenance", {{"version", LOBEFIT_VERSION}, {"command", command}}}};
}

}  // namespace lobefit
