#include "fit/table_problem.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <set>

#include "reference/sample_points.h"

namespace lobefit {

namespace {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr std::array<const char*, 3> channel_suffixes{".r", ".g", ".b"};
constexpr std::size_t batch_size = 1024;
/// Above it, fits go by normal equations: no Jacobian of so many rows is stored.
constexpr std::size_t most_jacobian_numbers = 1'000'000;

/// What data of any material decide by themselves.
bool has_prior(const ParameterInfo& info) {
  // A second lobe as wide as can be does not feel its scale: pulled at, it would stop where it just begins to.
  constexpr std::array decided{"dual_specular_roughness_scale",
                               "albedo",
                               "base_color",
                               "color",
                               "alpha",
                               "alpha_x",
                               "alpha_y",
                               "roughness",
                               "f0",
                               "specular"};
  return std::ranges::find(decided, info.name) == decided.end();
}

FitVariables make_variables(const ParameterValues& values, const TableModel& on_table, const FitOptions& options,
                            int channels) {
  FitVariables variables;
  variables.variable_of_slot.assign(values.flat().size(), -1);
  const auto is_free = [&](std::string_view name) {
    return std::ranges::find(options.free, name) != options.free.end();
  };
  std::vector<std::string_view> driven_by_tint;
  if (channels == 3) {
    for (const Product& product : known_products) {
      if (is_free(product.intensity) && is_free(product.tint)) driven_by_tint.push_back(product.intensity);
    }
  }
  for (const std::string& name : options.free) {
    const ParameterInfo& info = values.info(name);
    const auto offset = static_cast<std::size_t>(info.offset);
    if (on_table.set_by_axis(offset)) {
      throw Error(ExitCode::usage, "parameter '" + name + "' can't be free", values.owner(),
                  "an axis of the table sets it; leave it out of --free");
    }
    if (std::ranges::count(options.free, name) > 1) {
      throw Error(ExitCode::usage, "parameter '" + name + "' is free twice", values.owner(), "name it once");
    }
    if (std::ranges::find(driven_by_tint, name) != driven_by_tint.end()) {
      variables.intensity.push_back(offset);
      continue;
    }
    const auto product = std::ranges::find(known_products, name, &Product::tint);
    const bool is_tint = product != known_products.end() &&
                         std::ranges::find(driven_by_tint, product->intensity) != driven_by_tint.end();
    if (is_tint) variables.tint.push_back(offset);
    FitBounds bounds = bounds_of(is_tint ? values.info(product->intensity) : info, options);
    const double scale = is_tint ? values.get(product->intensity) : 1.0;
    const bool per_channel = info.components == 3 && channels == 3;
    for (int c = 0; c < info.components; ++c) {
      const std::size_t slot = offset + static_cast<std::size_t>(c);
      if (c == 0 || per_channel) {
        const std::string label = is_tint ? std::string(product->intensity) + " x " + name : name;
        variables.names.push_back(label + (per_channel ? channel_suffixes[static_cast<std::size_t>(c)] : ""));
        variables.parameters.push_back(name);
        variables.lower.push_back(bounds.lower);
        variables.upper.push_back(bounds.upper);
        variables.start.push_back(scale * values.flat()[slot]);
        variables.neutral.push_back(is_tint ? values.info(product->intensity).initial : info.initial);
        variables.width.push_back(has_prior(info) ? variables.range(variables.lower.size() - 1) : 0.0);
        variables.channel.push_back(per_channel ? c : -1);
      }
      variables.variable_of_slot[slot] = static_cast<int>(variables.names.size()) - 1;
    }
  }
  // Both lists in the order of the parameters, so that they run in step.
  std::ranges::sort(variables.intensity);
  std::ranges::sort(variables.tint);
  return variables;
}

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

bool find_channelwise(const Model& model) {
  const ParameterValues defaults = model.defaults();
  const DualModel& dual = dual_model(model);
  constexpr int parameter_sets = 6;
  constexpr std::size_t pairs = 32;
  std::vector<int> slots;
  std::vector<int> component;
  for (const ParameterInfo& info : defaults.list()) {
    for (int c = 0; info.components == 3 && c < 3; ++c) {
      slots.push_back(info.offset + c);
      component.push_back(c);
    }
  }
  for (int set = 0; set < parameter_sets; ++set) {
    std::vector<double> flat(defaults.flat().begin(), defaults.flat().end());
    for (const ParameterInfo& info : defaults.list()) {
      for (int c = 0; c < info.components; ++c) {
        const auto slot = static_cast<std::size_t>(info.offset + c);
        const double u = SamplePoints(Sampler::philox, {1, slot, own_stream})(static_cast<std::uint32_t>(set))[0];
        flat[slot] = info.choices.empty() ? info.lower + u * (std::min(info.upper, info.lower + 4.0) - info.lower)
                                          : std::floor(u * static_cast<double>(info.choices.size()));
      }
    }
    std::vector<Direction> wi, wo;
    for (std::size_t k = 0; k < pairs; ++k) {
      const auto draw = [&](std::uint64_t which) {
        const auto u = SamplePoints(Sampler::philox, {2, which, own_stream})(static_cast<std::uint32_t>(k));
        return direction(std::acos(u[0]), 2.0 * pi * u[1]);
      };
      wi.push_back(draw(0));
      wo.push_back(draw(1));
    }
    std::vector<double> values(3 * pairs), derivatives(3 * pairs * dual_width);
    for (std::size_t first = 0; first < slots.size(); first += dual_width) {
      std::vector<int> variable_of_slot(flat.size(), -1);
      const std::size_t count = std::min<std::size_t>(dual_width, slots.size() - first);
      for (std::size_t k = 0; k < count; ++k)
        variable_of_slot[static_cast<std::size_t>(slots[first + k])] = static_cast<int>(k);
      dual.evaluate(flat, variable_of_slot, 0, wi, wo, 3, values.data(), derivatives.data());
      for (int c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < pairs; ++i) {
          for (std::size_t k = 0; k < count; ++k) {
            const double derivative = derivatives[(static_cast<std::size_t>(c) * pairs + i) * dual_width + k];
            if (component[first + k] != c && derivative != 0.0) return false;
          }
        }
      }
    }
  }
  return true;
}

}  // namespace

int direction_block(const Direction& wi, const Direction& wo) {
  const auto part = [](const Direction& w) {
    return std::min(8, static_cast<int>(std::acos(std::min(1.0, w.z)) / (pi / 2) * 9.0));
  };
  const int a = part(wi), b = part(wo);
  return 9 * std::max(a, b) + std::min(a, b);
}

std::pair<int, int> ranges_of_block(int block) { return {block / 9, block % 9}; }

bool is_channelwise(const Model& model) {
  static std::mutex mutex;
  static std::map<std::string, bool, std::less<>> known;
  const std::scoped_lock lock(mutex);
  const auto found = known.find(model.info->name);
  if (found != known.end()) return found->second;
  return known[std::string(model.info->name)] = find_channelwise(model);
}

FitBounds bounds_of(const ParameterInfo& info, const FitOptions& options) {
  const auto given = std::ranges::find(options.bounds, info.name, &FitBounds::name);
  return given != options.bounds.end() ? *given : FitBounds{std::string(info.name), info.lower, info.upper};
}

TableProblem::TableProblem(const Model& model, const ParameterValues& values, const Table& table,
                           const FitOptions& options, const std::vector<double>& weights)
    : model_(model),
      dual_(dual_model(model)),
      table_(table),
      options_(options),
      values_(values),
      on_table_(model, values, table, options.mappings),
      variables_(make_variables(values, on_table_, options, table.channels)) {
  // Channels of a colour share a lane where they never meet: Callisto's 27 variables take 14 lanes.
  const bool shared = table.channels == 3 && is_channelwise(model);
  lane_of_slot_.assign(variables_.variable_of_slot.size(), -1);
  std::size_t lanes = 0;
  for (std::size_t v = 0; v < variables_.names.size(); ++v) {
    const bool joins = shared && variables_.channel[v] > 0;
    lane_of_variable_.push_back(joins ? lanes - 1 : lanes++);
  }
  for (std::size_t slot = 0; slot < lane_of_slot_.size(); ++slot) {
    const int v = variables_.variable_of_slot[slot];
    if (v >= 0) lane_of_slot_[slot] = static_cast<int>(lane_of_variable_[static_cast<std::size_t>(v)]);
  }
  lanes_ = std::max<std::size_t>(1, (lanes + dual_width - 1) / dual_width) * dual_width;
  if (!shared) std::ranges::fill(variables_.channel, -1);

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
    if (options.intervals == Intervals::blocks)
      batch.block.push_back(direction_block(batch.wi.back(), batch.wo.back()));
    residual_count_ += static_cast<std::size_t>(table.channels);
  }
  std::set<int> ranges;
  for (Batch& batch : batches_) {
    for (const int block : batch.block) {
      const auto [first, second] = ranges_of_block(block);
      ranges.insert({first, second});
    }
    for (const std::size_t entry : batch.entries) has_errors_ = has_errors_ || table.standard_error(entry) > 0.0f;
    for (int c = 0; c < table.channels; ++c) {
      for (std::size_t i = 0; i < batch.entries.size(); ++i) {
        batch.target.push_back(
            transform(options.quantity, table.value(batch.entries[i], c), batch.cos_theta_i[i]).value);
      }
    }
  }
  range_count_ = static_cast<int>(ranges.size());
}

LeastSquaresProblem TableProblem::problem(std::vector<double> start, const TableProblem* curvature_sample) const {
  LeastSquaresProblem result;
  result.residual_count = residual_count_;
  result.names = variables_.names;
  result.lower = variables_.lower;
  result.upper = variables_.upper;
  result.start = std::move(start);
  result.maximum_iterations = options_.maximum_iterations;
  if (residual_count_ * variables_.names.size() > most_jacobian_numbers) {
    result.condense = [this](std::span<const double> x, bool derivatives, NormalEquations& equations) {
      return condense(x, derivatives, equations);
    };
  } else {
    result.evaluate = [this](std::span<const double> x, std::span<double> residuals, double* jacobian) {
      return evaluate(x, residuals, jacobian);
    };
  }
  if (curvature_sample) {
    result.curvature_sample = [curvature_sample](std::span<const double> x, bool derivatives,
                                                 NormalEquations& equations) {
      return curvature_sample->condense(x, derivatives, equations);
    };
  }
  if (options_.intervals == Intervals::blocks) {
    if (range_count_ > 1) {
      result.degrees_of_freedom = range_count_ - 1;
      result.gradient_covariance = [this](std::span<const double> x) { return block_covariance(x); };
    }
  } else if (has_errors_) {
    result.degrees_of_freedom = table_.replicates.empty() ? 0 : replicate_count - 1;
    result.gradient_covariance = [this](std::span<const double> x) { return data_covariance(x); };
  }
  return result;
}

LeastSquaresProblem TableProblem::with_prior(std::vector<double> start, double prior) const {
  LeastSquaresProblem result = problem(std::move(start));
  result.evaluate = nullptr;
  result.condense = [this, prior](std::span<const double> x, bool derivatives, NormalEquations& equations) {
    if (!condense(x, derivatives, equations)) return false;
    for (std::size_t v = 0; v < x.size(); ++v) {
      if (variables_.width[v] == 0.0) continue;
      const double slope = prior / variables_.width[v];
      const double residual = slope * (x[v] - variables_.neutral[v]);
      equations.sum_of_squares += residual * residual;
      if (!derivatives) continue;
      equations.gradient[v] += slope * residual;
      equations.normal[v * x.size() + v] += slope * slope;
    }
    return true;
  };
  return result;
}

std::vector<double> TableProblem::variables_of(const ParameterValues& values) const {
  std::vector<double> x(variables_.names.size());
  std::vector<double> scale(values.flat().size(), 1.0);
  for (std::size_t k = 0; k < variables_.tint.size(); ++k) {
    for (std::size_t c = 0; c < 3; ++c) scale[variables_.tint[k] + c] = values.flat()[variables_.intensity[k]];
  }
  // Backwards, so that the first of the slots that a variable drives decides.
  for (std::size_t slot = values.flat().size(); slot-- > 0;) {
    const int v = variables_.variable_of_slot[slot];
    if (v >= 0) x[static_cast<std::size_t>(v)] = scale[slot] * values.flat()[slot];
  }
  return x;
}

ParameterValues TableProblem::values_at(std::span<const double> x) const {
  ParameterValues values = values_;
  const std::span<double> flat = values.flat();
  for (std::size_t slot = 0; slot < flat.size(); ++slot) {
    const int v = variables_.variable_of_slot[slot];
    if (v >= 0) flat[slot] = x[static_cast<std::size_t>(v)];
  }
  for (std::size_t k = 0; k < variables_.tint.size(); ++k) {
    const std::span<double> tint = flat.subspan(variables_.tint[k], 3);
    double largest = 0.0;
    for (const double u : tint) {
      if (std::abs(u) > std::abs(largest)) largest = u;
    }
    flat[variables_.intensity[k]] = largest;
    for (double& t : tint) t = largest != 0.0 ? t / largest : 1.0;
  }
  return values;
}

std::vector<double> TableProblem::flat_parameters(const Batch& batch, std::span<const double> x) const {
  std::vector<double> flat = on_table_.row(batch.parameter_row);
  for (const std::size_t slot : variables_.intensity) flat[slot] = 1.0;
  for (std::size_t s = 0; s < flat.size(); ++s) {
    if (variables_.variable_of_slot[s] >= 0) flat[s] = x[static_cast<std::size_t>(variables_.variable_of_slot[s])];
  }
  return flat;
}

/// Isolated: a thread that waits for its batches must not take up another fit meanwhile, within the first one's stack.
template <class Work>
void TableProblem::for_each_batch(Work&& work) const {
  tbb::this_task_arena::isolate([&] { tbb::parallel_for(std::size_t{0}, batches_.size(), work); });
}

TableProblem::BatchResult TableProblem::evaluate_batch(const Batch& batch, std::span<const double> x,
                                                       bool derivatives) const {
  const auto channels = static_cast<std::size_t>(table_.channels);
  const std::size_t n = batch.entries.size();
  const std::vector<double> flat = flat_parameters(batch, x);
  BatchResult result;
  result.residuals.resize(channels * n);
  result.bends.resize(channels * n);
  if (derivatives) result.derivatives.resize(channels * n * lanes_);
  std::vector<double> values(channels * n), some(derivatives ? channels * n * dual_width : 0), slope(channels * n);
  if (!derivatives) {
    std::vector<Rgb> colors(n);
    model_.evaluate_all(flat, batch.wi, batch.wo, colors);
    for (std::size_t i = 0; i < n; ++i) {
      const std::array<double, 3> components{colors[i].x, colors[i].y, colors[i].z};
      for (std::size_t c = 0; c < channels; ++c) values[c * n + i] = components[c];
    }
  }
  for (std::size_t first = 0; first == 0 || (derivatives && first < lanes_); first += dual_width) {
    if (derivatives) {
      dual_.evaluate(flat, lane_of_slot_, static_cast<int>(first), batch.wi, batch.wo, table_.channels, values.data(),
                     some.data());
    }
    if (first == 0) {
      for (std::size_t c = 0; c < channels; ++c) {
        for (std::size_t i = 0; i < n; ++i) {
          const std::size_t row = c * n + i;
          const ValueAndSlope model = transform(options_.quantity, values[row], batch.cos_theta_i[i]);
          const RobustResidual residual = robust(options_.loss, options_.loss_scale, model.value - batch.target[row]);
          result.residuals[row] = batch.root_weight[i] * residual.value;
          slope[row] = batch.root_weight[i] * residual.slope * model.slope;
          result.bends[row] = residual.bend;
          result.finite = result.finite && std::isfinite(result.residuals[row]);
        }
      }
    }
    if (!derivatives) break;
    for (std::size_t row = 0; row < channels * n; ++row) {
      for (std::size_t k = 0; k < dual_width; ++k)
        result.derivatives[row * lanes_ + first + k] = slope[row] * some[row * dual_width + k];
    }
  }
  return result;
}

void TableProblem::add_row(const BatchResult& result, std::size_t row, int channel, double factor, double* g) const {
  for (std::size_t v = 0; v < lane_of_variable_.size(); ++v) {
    if (variables_.channel[v] >= 0 && variables_.channel[v] != channel) continue;
    g[v] += factor * result.derivatives[row * lanes_ + lane_of_variable_[v]];
  }
}

bool TableProblem::evaluate(std::span<const double> x, std::span<double> residuals, double* jacobian) const {
  const std::size_t p = x.size();
  const auto channels = static_cast<std::size_t>(table_.channels);
  std::vector<char> finite(batches_.size(), 1);
  for_each_batch([&](std::size_t index) {
    const Batch& batch = batches_[index];
    const std::size_t n = batch.entries.size();
    const BatchResult result = evaluate_batch(batch, x, jacobian != nullptr);
    finite[index] = result.finite;
    for (std::size_t c = 0; c < channels; ++c) {
      for (std::size_t i = 0; i < n; ++i) {
        const std::size_t row = batch.first_residual + i * channels + c;
        residuals[row] = result.residuals[c * n + i];
        if (!jacobian) continue;
        std::fill_n(jacobian + row * p, p, 0.0);
        add_row(result, c * n + i, static_cast<int>(c), 1.0, jacobian + row * p);
      }
    }
  });
  return std::ranges::all_of(finite, [](char f) { return f != 0; });
}

bool TableProblem::condense(std::span<const double> x, bool derivatives, NormalEquations& result) const {
  const std::size_t p = x.size();
  const auto channels = static_cast<std::size_t>(table_.channels);
  struct Part {
    double sum_of_squares = 0.0;
    std::vector<RowMatrix> normal;          // per channel, between lanes
    std::vector<Eigen::VectorXd> gradient;  // per channel and lane
    bool finite = true;
  };
  std::vector<Part> parts(batches_.size());
  const auto lanes = static_cast<Eigen::Index>(lanes_);
  for_each_batch([&](std::size_t index) {
    const BatchResult batch = evaluate_batch(batches_[index], x, derivatives);
    const auto n = static_cast<Eigen::Index>(batches_[index].entries.size());
    Part& part = parts[index];
    part.finite = batch.finite;
    for (std::size_t c = 0; c < channels; ++c) {
      const Eigen::Map<const Eigen::VectorXd> r(batch.residuals.data() + static_cast<Eigen::Index>(c) * n, n);
      part.sum_of_squares += r.squaredNorm();
      if (!derivatives) continue;
      const Eigen::Map<const RowMatrix> j(batch.derivatives.data() + static_cast<Eigen::Index>(c) * n * lanes, n,
                                          lanes);
      part.normal.emplace_back(j.transpose() * j);
      part.gradient.emplace_back(j.transpose() * r);
    }
  });
  result.sum_of_squares = 0.0;
  result.gradient.assign(p, 0.0);
  result.normal.assign(p * p, 0.0);
  // In the order of the batches, so that the sums do not depend on the threads.
  for (const Part& part : parts) {
    if (!part.finite) return false;
    result.sum_of_squares += part.sum_of_squares;
    for (std::size_t c = 0; c < part.normal.size(); ++c) {
      const auto takes_part = [&](std::size_t v) {
        return variables_.channel[v] < 0 || variables_.channel[v] == static_cast<int>(c);
      };
      for (std::size_t v = 0; v < p; ++v) {
        if (!takes_part(v)) continue;
        const auto row = static_cast<Eigen::Index>(lane_of_variable_[v]);
        result.gradient[v] += part.gradient[c][row];
        for (std::size_t w = 0; w < p; ++w) {
          if (takes_part(w))
            result.normal[v * p + w] += part.normal[c](row, static_cast<Eigen::Index>(lane_of_variable_[w]));
        }
      }
    }
  }
  return true;
}

/// Σ over replicates of g gᵀ/(R(R-1)) with g = Jᵀ(residual of the replicate - residual); without replicates, the sum
/// over independent entries.
std::vector<double> TableProblem::data_covariance(std::span<const double> x) const {
  const std::size_t p = x.size();
  const auto replicates = table_.replicates.size() / table_.values.size();
  std::vector<double> covariance(p * p, 0.0);
  const auto add_product = [&](const double* g, double factor) {
    for (std::size_t k = 0; k < p; ++k) {
      for (std::size_t l = 0; l < p; ++l) covariance[k * p + l] += factor * g[k] * g[l];
    }
  };
  std::vector<double> of_replicates(replicates * p, 0.0), g(p);
  for (const Batch& batch : batches_) {
    const std::size_t n = batch.entries.size();
    const BatchResult result = evaluate_batch(batch, x, true);
    for (std::size_t i = 0; i < n; ++i) {
      for (int c = 0; c < table_.channels; ++c) {
        const std::size_t row = static_cast<std::size_t>(c) * n + i;
        const std::size_t entry = batch.entries[i];
        // By how much the residual's pull moves with its table value.
        const double slope = batch.root_weight[i] * result.bends[row] *
                             transform(options_.quantity, table_.value(entry, c), batch.cos_theta_i[i]).slope;
        if (replicates == 0) {
          std::ranges::fill(g, 0.0);
          add_row(result, row, c, slope * table_.standard_error(entry, c), g.data());
          add_product(g.data(), 1.0);
        }
        for (std::size_t r = 0; r < replicates; ++r) {
          const double change = table_.replicate(static_cast<int>(r), entry, c) - table_.value(entry, c);
          add_row(result, row, c, slope * change, of_replicates.data() + r * p);
        }
      }
    }
  }
  for (std::size_t r = 0; r < replicates; ++r)
    add_product(of_replicates.data() + r * p,
                1.0 / (static_cast<double>(replicates) * (static_cast<double>(replicates) - 1.0)));
  return covariance;
}

/// What the gradient owes to the choice of directions: the covariance of Σ g over blocks, g = Jᵀr of a block, where
/// blocks that have a range of polar angles in common are not independent (dyadic clusters: Aronow, Samii & Assenova
/// 2015, equation 7). Misfit runs smoothly over neighbouring directions, so that single entries are no witnesses at
/// all, and along a whole range when light or view stays there.
std::vector<double> TableProblem::block_covariance(std::span<const double> x) const {
  const std::size_t p = x.size();
  std::vector<std::map<int, std::vector<double>>> parts(batches_.size());
  for_each_batch([&](std::size_t index) {
    const Batch& batch = batches_[index];
    const std::size_t n = batch.entries.size();
    const BatchResult result = evaluate_batch(batch, x, true);
    for (std::size_t i = 0; i < n; ++i) {
      std::vector<double>& g = parts[index][batch.block[i]];
      g.resize(p, 0.0);
      for (int c = 0; c < table_.channels; ++c) {
        const std::size_t row = static_cast<std::size_t>(c) * n + i;
        add_row(result, row, c, result.residuals[row], g.data());
      }
    }
  });
  std::map<int, std::vector<double>> blocks;
  for (const auto& part : parts) {
    for (const auto& [block, g] : part) {
      std::vector<double>& sum = blocks[block];
      sum.resize(p, 0.0);
      for (std::size_t k = 0; k < p; ++k) sum[k] += g[k];
    }
  }
  std::map<int, Eigen::VectorXd> ranges;
  const auto size = static_cast<Eigen::Index>(p);
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(size, size), shared = own;
  for (const auto& [block, values] : blocks) {
    const Eigen::Map<const Eigen::VectorXd> g(values.data(), size);
    const auto [first, second] = ranges_of_block(block);
    ranges.try_emplace(first, Eigen::VectorXd::Zero(size)).first->second += g;
    own += g * g.transpose();
    shared -= g * g.transpose();
    if (first == second) continue;
    ranges.try_emplace(second, Eigen::VectorXd::Zero(size)).first->second += g;
    shared -= g * g.transpose();
  }
  for (const auto& [range, g] : ranges) shared += g * g.transpose();
  // What pairs of different blocks add is a difference of squares and may come out negative: then it counts as nothing,
  // and the blocks' own squares remain.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(shared);
  const auto count = static_cast<double>(ranges.size());
  const RowMatrix sum =
      count / (count - 1.0) *
      (own + eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose());
  std::vector<double> covariance(sum.data(), sum.data() + sum.size());
  return covariance;
}

}  // namespace lobefit
