#include "fit/fit.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>

#include "fit/dual_model.h"
#include "reference/json_reader.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

/// Which variable of the solver drives which slots of the model's flat parameters.
struct Variables {
  std::vector<std::string> names;
  std::vector<double> lower, upper, start;
  std::vector<int> variable_of_slot;
};

constexpr std::array<const char*, 3> channel_suffixes{".r", ".g", ".b"};

/// Where a fit may move a parameter.
FitBounds bounds_of(const ParameterInfo& info, const FitOptions& options) {
  const auto given = std::ranges::find(options.bounds, info.name, &FitBounds::name);
  return given != options.bounds.end() ? *given : FitBounds{std::string(info.name), info.lower, info.upper};
}

Variables make_variables(const ParameterValues& values, const TableModel& on_table, const FitOptions& options,
                         int channels) {
  Variables variables;
  variables.variable_of_slot.assign(values.flat().size(), -1);
  for (const std::string& name : options.free) {
    const ParameterInfo& info = values.info(name);
    const auto offset = static_cast<std::size_t>(info.offset);
    if (on_table.set_by_axis(offset)) {
      throw Error(ExitCode::usage, "parameter '" + name + "' can't be free", values.owner(),
                  "an axis of the table sets it; leave it out of --free");
    }
    if (variables.variable_of_slot[offset] >= 0) {
      throw Error(ExitCode::usage, "parameter '" + name + "' is free twice", values.owner(), "name it once");
    }
    const bool per_channel = info.components == 3 && channels == 3;
    for (int c = 0; c < info.components; ++c) {
      const std::size_t slot = offset + static_cast<std::size_t>(c);
      if (c == 0 || per_channel) {
        variables.names.push_back(name + (per_channel ? channel_suffixes[static_cast<std::size_t>(c)] : ""));
        const FitBounds bounds = bounds_of(info, options);
        variables.lower.push_back(bounds.lower);
        variables.upper.push_back(bounds.upper);
        variables.start.push_back(values.flat()[slot]);
      }
      variables.variable_of_slot[slot] = static_cast<int>(variables.names.size()) - 1;
    }
  }
  return variables;
}

/// Entries of one parameter row, small enough to be one unit of parallel work.
struct Batch {
  std::size_t parameter_row;
  std::size_t first_residual;
  std::vector<std::size_t> entries;
  std::vector<Direction> wi, wo;
  std::vector<double> root_weight, cos_theta_i;
};

constexpr std::size_t batch_size = 1024;

/// The replicate whose numbers fits draw: a table rendered with the same seed has far fewer.
constexpr std::uint32_t own_stream = ~0u;

struct RobustResidual {
  double value, slope;
  double bend;  // by how much the pull on the parameters, value × slope, follows the data: its derivative over slope
};

/// √ρ(s²) with the sign of s, and its derivative: squaring it gives the loss. ρ as in Ceres: Huber, Cauchy.
RobustResidual robust(Loss loss, double scale, double residual) {
  const double s = residual / scale;
  const double magnitude = std::abs(s);
  switch (loss) {
    case Loss::none: break;
    case Loss::huber: {
      if (magnitude <= 1.0) break;
      const double root = std::sqrt(2.0 * magnitude - 1.0);
      return {std::copysign(scale * root, residual), 1.0 / root, 0.0};  // the pull is constant
    }
    case Loss::cauchy: {
      if (magnitude < 1e-8) break;
      const double root = std::sqrt(std::log1p(s * s));
      const double slope = magnitude / ((1.0 + s * s) * root);
      return {std::copysign(scale * root, residual), slope, (1.0 - s * s) / (square(1.0 + s * s) * slope)};
    }
  }
  return {residual, 1.0, 1.0};
}

/// The fit as a least-squares problem over a set of entries.
class TableProblem {
 public:
  TableProblem(const Model& model, const ParameterValues& values, const Table& table, const FitOptions& options,
               const std::vector<double>& weights)
      : dual_(dual_model(model)),
        table_(table),
        options_(options),
        on_table_(model, values, table, options.mappings),
        variables_(make_variables(values, on_table_, options, table.channels)) {
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      if (weights[entry] == 0.0) continue;
      const std::size_t row = table.parameter_row(entry);
      if (batches_.empty() || batches_.back().parameter_row != row || batches_.back().entries.size() == batch_size) {
        batches_.push_back({.parameter_row = row, .first_residual = residual_count_});
      }
      Batch& batch = batches_.back();
      batch.entries.push_back(entry);
      batch.wi.push_back(table.wi(entry));
      batch.wo.push_back(table.wo(entry));
      batch.cos_theta_i.push_back(batch.wi.back().z);
      batch.root_weight.push_back(std::sqrt(weights[entry] / table.channels));
      residual_count_ += static_cast<std::size_t>(table.channels);
    }
  }

  const Variables& variables() const { return variables_; }

  LeastSquaresProblem problem(std::vector<double> start) const {
    LeastSquaresProblem result;
    result.residual_count = residual_count_;
    result.names = variables_.names;
    result.lower = variables_.lower;
    result.upper = variables_.upper;
    result.start = std::move(start);
    result.maximum_iterations = options_.maximum_iterations;
    result.evaluate = [this](std::span<const double> x, std::span<double> residuals, double* jacobian) {
      return evaluate(x, residuals, jacobian);
    };
    const bool has_errors =
        std::any_of(table_.stderr_values.begin(), table_.stderr_values.end(), [](float error) { return error > 0.0f; });
    if (has_errors) {
      result.degrees_of_freedom = table_.replicates.empty() ? 0 : replicate_count - 1;
      result.gradient_covariance = [this](std::span<const double> x, std::span<const double> jacobian) {
        return gradient_covariance(x, jacobian);
      };
    }
    return result;
  }

 private:
  std::vector<double> flat_parameters(const Batch& batch, std::span<const double> x) const {
    std::vector<double> flat = on_table_.row(batch.parameter_row);
    for (std::size_t s = 0; s < flat.size(); ++s) {
      if (variables_.variable_of_slot[s] >= 0) flat[s] = x[static_cast<std::size_t>(variables_.variable_of_slot[s])];
    }
    return flat;
  }

  bool evaluate(std::span<const double> x, std::span<double> residuals, double* jacobian) const {
    const std::size_t p = x.size();
    const auto channels = static_cast<std::size_t>(table_.channels);
    std::vector<char> finite(batches_.size(), 1);
    tbb::parallel_for(std::size_t{0}, batches_.size(), [&](std::size_t index) {
      const Batch& batch = batches_[index];
      const std::size_t n = batch.entries.size();
      const std::vector<double> flat = flat_parameters(batch, x);
      std::vector<double> values(channels * n), derivatives(channels * n * dual_width);
      for (std::size_t first = 0; first == 0 || (jacobian && first < p); first += dual_width) {
        dual_.evaluate(flat, variables_.variable_of_slot, static_cast<int>(first), batch.wi, batch.wo, table_.channels,
                       values.data(), derivatives.data());
        for (std::size_t c = 0; c < channels; ++c) {
          for (std::size_t i = 0; i < n; ++i) {
            const std::size_t row = batch.first_residual + i * channels + c;
            const ValueAndSlope model = transform(options_.quantity, values[c * n + i], batch.cos_theta_i[i]);
            const double target =
                transform(options_.quantity, table_.value(batch.entries[i], static_cast<int>(c)), batch.cos_theta_i[i])
                    .value;
            const RobustResidual residual = robust(options_.loss, options_.loss_scale, model.value - target);
            residuals[row] = batch.root_weight[i] * residual.value;
            if (!std::isfinite(residuals[row])) finite[index] = 0;
            if (!jacobian) continue;
            const double slope = batch.root_weight[i] * residual.slope * model.slope;
            for (std::size_t k = first; k < std::min(p, first + dual_width); ++k) {
              jacobian[row * p + k] = slope * derivatives[(c * n + i) * dual_width + k - first];
            }
          }
        }
      }
    });
    return std::all_of(finite.begin(), finite.end(), [](char f) { return f != 0; });
  }

  /// Covariance of the cost's gradient under the table's error.
  std::vector<double> gradient_covariance(std::span<const double> x, std::span<const double> jacobian) const {
    const std::size_t p = x.size();
    std::vector<double> covariance(p * p, 0.0);
    const auto add_product = [&](const std::vector<double>& g, double factor) {
      for (std::size_t k = 0; k < p; ++k) {
        for (std::size_t l = 0; l < p; ++l) covariance[k * p + l] += factor * g[k] * g[l];
      }
    };
    const std::vector<double> slopes = data_slopes(x);
    std::vector<double> g(p);
    const auto replicates = static_cast<int>(table_.replicates.size() / table_.values.size());
    if (replicates > 0) {
      for (int r = 0; r < replicates; ++r) {
        std::fill(g.begin(), g.end(), 0.0);
        for_each_residual([&](std::size_t row, std::size_t entry, int c) {
          const double difference = slopes[row] * (table_.replicate(r, entry, c) - table_.value(entry, c));
          for (std::size_t k = 0; k < p; ++k) g[k] += jacobian[row * p + k] * difference;
        });
        add_product(g, 1.0 / (replicates * (replicates - 1.0)));
      }
    } else {
      for_each_residual([&](std::size_t row, std::size_t entry, int c) {
        const double error = slopes[row] * table_.standard_error(entry, c);
        for (std::size_t k = 0; k < p; ++k) g[k] = jacobian[row * p + k] * error;
        add_product(g, 1.0);
      });
    }
    return covariance;
  }

  /// By how much each residual's pull moves with its table value, per Jacobian row.
  std::vector<double> data_slopes(std::span<const double> x) const {
    const auto channels = static_cast<std::size_t>(table_.channels);
    std::vector<double> slopes(residual_count_);
    for (const Batch& batch : batches_) {
      const std::size_t n = batch.entries.size();
      std::vector<double> values(channels * n), derivatives(channels * n * dual_width);
      dual_.evaluate(flat_parameters(batch, x), variables_.variable_of_slot, 0, batch.wi, batch.wo, table_.channels,
                     values.data(), derivatives.data());
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t c = 0; c < channels; ++c) {
          const ValueAndSlope target =
              transform(options_.quantity, table_.value(batch.entries[i], static_cast<int>(c)), batch.cos_theta_i[i]);
          const double model = transform(options_.quantity, values[c * n + i], batch.cos_theta_i[i]).value;
          slopes[batch.first_residual + i * channels + c] =
              batch.root_weight[i] * target.slope *
              robust(options_.loss, options_.loss_scale, model - target.value).bend;
        }
      }
    }
    return slopes;
  }

  /// Calls visit(row, entry, channel) for every residual.
  template <class Visit>
  void for_each_residual(Visit&& visit) const {
    for (const Batch& batch : batches_) {
      for (std::size_t i = 0; i < batch.entries.size(); ++i) {
        for (int c = 0; c < table_.channels; ++c) {
          visit(batch.first_residual + i * static_cast<std::size_t>(table_.channels) + static_cast<std::size_t>(c),
                batch.entries[i], c);
        }
      }
    }
  }

  const DualModel& dual_;
  const Table& table_;
  const FitOptions& options_;
  TableModel on_table_;
  Variables variables_;
  std::vector<Batch> batches_;
  std::size_t residual_count_ = 0;
};

/// Start number `index` > 0: a scrambled Sobol pair per two variables, inside the ranges.
std::vector<double> further_start(const Variables& variables, std::uint64_t seed, int index) {
  std::vector<double> start(variables.start.size());
  for (std::size_t i = 0; i < start.size(); ++i) {
    const SamplePoints points(Sampler::sobol, {seed, i / 2, own_stream});
    const double u = points(static_cast<std::uint32_t>(index))[i % 2];
    start[i] = variables.lower[i] + u * (variables.upper[i] - variables.lower[i]);
  }
  return start;
}

std::vector<FitMetric> all_metrics(const Table& table, std::span<const float> values,
                                   const std::vector<double>& weights) {
  std::vector<FitMetric> metrics;
  for (std::size_t q = 0; q < quantity_names.size(); ++q) {
    metrics.push_back(
        {std::string(quantity_names[q]), rms_difference(table, values, static_cast<Quantity>(q), weights)});
  }
  return metrics;
}

void normalise(std::vector<double>& weights, const char* mend) {
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!(sum > 0.0)) throw Error(ExitCode::usage, "no entry is left", "--holdout", mend);
  for (double& weight : weights) weight /= sum;
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

Fit fit(const Model& model, const ParameterValues& values, const Table& table, const FitOptions& options,
        Monitor& monitor) {
  std::vector<double> weights = entry_weights(table, options.weights, options.quantity);
  std::vector<double> held_out;
  if (options.holdout > 0.0) {
    held_out = weights;
    for (std::size_t entry = 0; entry < weights.size(); ++entry) {
      const double u = SamplePoints(Sampler::philox, {options.seed, entry, own_stream})(0)[0];
      (u < options.holdout ? weights : held_out)[entry] = 0.0;
    }
    normalise(weights, "hold out a smaller fraction");
    normalise(held_out, "hold out a larger fraction, or none");
  }
  const TableProblem problem(model, values, table, options, weights);
  const Variables& variables = problem.variables();

  Fit result;
  result.model = std::string(model.info->name);
  result.options = options;
  result.mappings = options.mappings;
  result.starts_tried = variables.names.empty() ? 1 : options.starts;
  monitor.begin("fit " + result.model, static_cast<std::uint64_t>(result.starts_tried));
  for (int start = 0; start < result.starts_tried; ++start) {
    const LeastSquaresSolution solution =
        solve(problem.problem(start == 0 ? variables.start : further_start(variables, options.seed, start)), monitor);
    // Written so that a first start without a finite sum loses to any other.
    if (start == 0 || !(result.solution.sum_of_squares <= solution.sum_of_squares)) result.solution = solution;
    monitor.advance(1);
  }
  monitor.end();

  ParameterValues fitted = values;
  for (std::size_t slot = 0; slot < fitted.flat().size(); ++slot) {
    const int variable = variables.variable_of_slot[slot];
    if (variable >= 0) fitted.flat()[slot] = result.solution.variables[static_cast<std::size_t>(variable)].value;
  }
  const TableModel on_table(model, fitted, table, options.mappings);
  for (const ParameterInfo& info : fitted.list()) {
    const auto offset = static_cast<std::size_t>(info.offset);
    if (on_table.set_by_axis(offset)) continue;
    const bool grey =
        info.components == 1 ||
        (fitted.flat()[offset] == fitted.flat()[offset + 1] && fitted.flat()[offset] == fitted.flat()[offset + 2] &&
         variables.variable_of_slot[offset] == variables.variable_of_slot[offset + 1]);
    for (std::size_t c = 0; c < (grey ? 1u : 3u); ++c) {
      const FitBounds bounds = bounds_of(info, options);
      FitParameter parameter{.name = std::string(info.name) + (grey ? "" : channel_suffixes[c]),
                             .lower = bounds.lower,
                             .upper = bounds.upper};
      const int variable = variables.variable_of_slot[offset + c];
      parameter.free = variable >= 0;
      if (parameter.free) {
        parameter.estimate = result.solution.variables[static_cast<std::size_t>(variable)];
      } else {
        const double value = fitted.flat()[offset + c];
        parameter.estimate = {.value = value, .ci_low = value, .ci_high = value};
      }
      result.parameters.push_back(std::move(parameter));
    }
  }
  const Table rendered = on_table.render();
  result.metrics = all_metrics(table, rendered.values, weights);
  if (!held_out.empty()) result.holdout = all_metrics(table, rendered.values, held_out);
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

namespace {

Json metrics_json(const std::vector<FitMetric>& metrics) {
  Json json = Json::object();
  for (const FitMetric& metric : metrics) json[metric.name] = metric.value;
  return json;
}

}  // namespace

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
        {"message", solution.termination},
        {"metric", quantity_names[static_cast<std::size_t>(options.quantity)]},
        {"weights", weight_names(options.weights)},
        {"loss", loss_names[static_cast<std::size_t>(options.loss)]}}},
      {"provenance",
       {{"version", LOBEFIT_VERSION}, {"command", command}, {"seed", options.seed}, {"table_sha256", table_sha256}}}};
  if (!mappings.empty()) document["map"] = mapping_list;
  return document;
}

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
