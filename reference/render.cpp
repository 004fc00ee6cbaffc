#include "reference/render.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <functional>

#include "reference/json_reader.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

/// A table with its axes and provenance but without entries, and the parameters of each of its rows.
struct Canvas {
  Table table;
  std::vector<ParameterValues> rows;
};

/// A surface that does not transmit has no BRDF beyond the horizon.
void check_hemisphere(const Grid& grid, const std::string& owner) {
  for (const Axis* axis : {&grid.theta_i, &grid.theta_o}) {
    if (axis->values.back() >= 90.0) {
      throw Error(ExitCode::usage, axis->name + " = " + number_text(axis->values.back()) + " is out of range", owner,
                  "choose angles from 0 to below 90 degrees: directions lie above the surface");
    }
  }
}

Canvas make_canvas(const ParameterValues& values, std::vector<Axis> parameter_axes, const Grid& grid) {
  Canvas canvas;
  Table& table = canvas.table;
  table.grid = grid;
  table.parameter_axes = std::move(parameter_axes);
  table.model = values.owner();
  table.version = LOBEFIT_VERSION;
  table.parameters = Json::object();
  for (const Axis& axis : table.parameter_axes) {
    if (!values.info(axis.name).choices.empty() || values.info(axis.name).file) {
      throw Error(ExitCode::usage, "parameter '" + axis.name + "' can't be an axis", values.owner(),
                  "it is no number; render one table per choice with --set");
    }
  }
  for (const ParameterInfo& info : values.list()) {
    const bool is_axis = std::any_of(table.parameter_axes.begin(), table.parameter_axes.end(),
                                     [&](const Axis& axis) { return axis.name == info.name; });
    if (is_axis) continue;
    if (info.file) {
      // What the file held, not where it lay.
      const std::string path = values.path(info.name);
      if (!path.empty()) table.parameters[std::string(info.name)] = parse_json(read_file(path), path);
      continue;
    }
    const std::span<const double> slots = values.components(info);
    if (!info.choices.empty()) {
      table.parameters[std::string(info.name)] = std::string(values.choice(info.name));
    } else if (info.components == 1) {
      table.parameters[std::string(info.name)] = slots[0];
    } else {
      table.parameters[std::string(info.name)] = std::vector<double>(slots.begin(), slots.end());
    }
  }
  for (std::size_t row = 0; row < table.parameter_rows(); ++row) {
    ParameterValues at_row = values;
    const std::vector<double> coordinates = table.parameter_values(row);
    for (std::size_t i = 0; i < coordinates.size(); ++i) at_row.set(table.parameter_axes[i].name, coordinates[i]);
    canvas.rows.push_back(std::move(at_row));
  }
  return canvas;
}

double channel_of(const Rgb& value, int channel) { return channel == 0 ? value.x : channel == 1 ? value.y : value.z; }

void store(Table& table, std::size_t entry, const Rgb& value) {
  for (int c = 0; c < table.channels; ++c) {
    table.values[static_cast<std::size_t>(c) * table.entries() + entry] = static_cast<float>(channel_of(value, c));
  }
}

/// Runs `line(y)`, which advances the monitor by `steps`, for every line of the table that the job wants and earlier
/// runs did not finish. Lines are independent, so neither threads nor shards nor interruptions can change their bits.
void for_each_line(Table& table, std::uint64_t steps, Monitor& monitor, const RenderJob& job,
                   const std::function<void(std::size_t)>& line) {
  const std::size_t height = table.height();
  if (job.shards.count > height) {
    throw Error(ExitCode::usage,
                std::to_string(height) + " lines can't be cut into " + std::to_string(job.shards.count) + " shards",
                "--shard", "choose at most " + std::to_string(height) + " shards");
  }
  table.shards = job.shards;
  const std::vector<bool> done = job.part ? job.part->begin(table) : std::vector<bool>(height, false);
  std::vector<std::size_t> lines;
  std::uint64_t finished = 0;
  for (std::size_t y = 0; y < height; ++y) {
    if (!job.shards.hold(y)) {
      std::fill_n(table.valid.begin() + static_cast<std::ptrdiff_t>(y * table.width()), table.width(), std::uint8_t{0});
    } else if (done[y]) {
      ++finished;
    } else {
      lines.push_back(y);
    }
  }
  monitor.begin("render " + table.model, (finished + lines.size()) * steps, finished * steps);
  try {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, lines.size(), 1), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        monitor.check();
        line(lines[i]);
        // What is not a finite number is masked, never passed on.
        table.mask_what_is_not_finite(lines[i] * table.width(), table.width());
        if (job.part) job.part->keep(lines[i]);
      }
    });
  } catch (...) {
    if (job.part) job.part->flush();
    throw;
  }
  monitor.end();
}

/// Where the results of one line of a table go: entries [first, first + n).
class LineWriter {
 public:
  LineWriter(Table& table, std::size_t first, std::size_t n)
      : table_(&table),
        first_(first),
        n_(n),
        orders_(static_cast<std::size_t>(table.orders)),
        means_(n * replicate_count),
        order_means_(n * orders_ * replicate_count) {}

  Line replicate(std::size_t r) {
    return {.values = std::span(means_).subspan(r * n_, n_),
            .orders = std::span(order_means_).subspan(r * orders_ * n_, orders_ * n_)};
  }

  void store_exact() {
    for (std::size_t j = 0; j < n_; ++j) store(*table_, first_ + j, means_[j]);
    for (std::size_t k = 0; k < orders_ * n_; ++k) {
      table_->order_values[order_slot(k)] = static_cast<float>(order_means_[k]);
    }
  }

  /// Means, errors and replicates of the line; returns the largest standard error of a value. Those that are no finite
  /// numbers do not count: more samples would not mend them.
  double store_estimates() {
    double worst = 0.0;
    std::array<double, replicate_count> column;
    for (std::size_t j = 0; j < n_; ++j) {
      Rgb mean;
      for (int c = 0; c < table_->channels; ++c) {
        for (std::size_t r = 0; r < replicate_count; ++r) column[r] = channel_of(means_[r * n_ + j], c);
        const std::size_t slot = static_cast<std::size_t>(c) * table_->entries() + first_ + j;
        const MeanAndError result = summarise(column, slot, table_->stderr_values, table_->replicates);
        (c == 0 ? mean.x : c == 1 ? mean.y : mean.z) = result.mean;
        if (std::isfinite(result.standard_error)) worst = max(worst, result.standard_error);
      }
      store(*table_, first_ + j, mean);
    }
    for (std::size_t k = 0; k < orders_ * n_; ++k) {
      for (std::size_t r = 0; r < replicate_count; ++r) column[r] = order_means_[r * orders_ * n_ + k];
      const std::size_t slot = order_slot(k);
      table_->order_values[slot] =
          static_cast<float>(summarise(column, slot, table_->order_stderr, table_->order_replicates).mean);
    }
    return worst;
  }

 private:
  std::size_t order_slot(std::size_t k) const { return k / n_ * table_->entries() + first_ + k % n_; }

  static MeanAndError summarise(const std::array<double, replicate_count>& column, std::size_t slot,
                                std::vector<float>& errors, std::vector<float>& replicates) {
    const MeanAndError result = mean_and_error(std::span<const double>(column));
    errors[slot] = static_cast<float>(result.standard_error);
    for (std::size_t r = 0; r * errors.size() < replicates.size(); ++r) {
      replicates[r * errors.size() + slot] = static_cast<float>(column[r]);
    }
    return result;
  }

  Table* table_;
  std::size_t first_, n_, orders_;
  std::vector<Rgb> means_;           // [replicate][light]
  std::vector<double> order_means_;  // [replicate][order][light]
};

/// One line by Monte Carlo: entries [first, first + wi.size()).
void sample_line(const Integrator& integrator, std::span<const Direction> wi, const Direction& wo, std::size_t first,
                 std::uint64_t key, const RenderOptions& options, Table& table, Monitor& monitor,
                 std::uint64_t steps_per_replicate) {
  LineWriter line(table, first, wi.size());
  for (SamplingOptions sampling = options.sampling;; sampling.samples *= 2) {
    for (std::uint32_t r = 0; r < replicate_count; ++r) {
      monitor.check();
      integrator.sample_row(wo, wi, SamplePoints(sampling.sampler, {sampling.seed, key, r}), sampling.per_replicate(),
                            true, line.replicate(r));
      if (steps_per_replicate > 0) monitor.advance(steps_per_replicate);
    }
    const double worst = line.store_estimates();
    if (sampling.stderr_target > 0.0 && worst > sampling.stderr_target && sampling.samples * 2 <= most_samples)
      continue;
    if (!table.sample_counts.empty()) {
      const auto count = static_cast<float>(std::uint64_t{sampling.per_replicate()} * replicate_count);
      std::fill_n(table.sample_counts.begin() + static_cast<std::ptrdiff_t>(first), wi.size(), count);
    }
    return;
  }
}

}  // namespace

Table render(const Reference& reference, const ParameterValues& values, std::vector<Axis> parameter_axes,
             const Grid& grid, const RenderOptions& options, Monitor& monitor, const RenderJob& job) {
  if (!reference.sphere) check_hemisphere(grid, std::string(reference.name));
  Canvas canvas = make_canvas(values, std::move(parameter_axes), grid);
  std::vector<std::unique_ptr<const Integrator>> integrators;
  Table& table = canvas.table;
  for (const ParameterValues& row : canvas.rows) {
    integrators.push_back(reference.make(row));
    table.channels = std::max(table.channels, integrators.back()->channels());
  }
  if (options.orders) {
    table.orders = integrators.front()->orders();
    if (table.orders == 0) {
      throw Error(ExitCode::usage, "these parameters have no orders to keep apart", "--orders",
                  "leave it out, or let light bounce: --set bounces=all");
    }
  }
  table.allocate();
  table.method = options.exact ? "exact" : "monte_carlo";
  if (!options.exact) {
    table.seed = options.sampling.seed;
    table.samples = std::uint64_t{options.sampling.per_replicate()} * replicate_count;
    table.sampler = options.sampling.sampler == Sampler::sobol ? "sobol" : "philox";
    table.stderr_target = options.sampling.stderr_target;
    table.shared_facets = options.shared_facets;
    if (options.sampling.stderr_target > 0.0) table.sample_counts.assign(table.entries(), 0.0f);
    if (options.shared_facets) {
      table.replicates.assign(table.values.size() * replicate_count, 0.0f);
      table.order_replicates.assign(table.order_values.size() * replicate_count, 0.0f);
    }
  }
  // A line of shared facets may take minutes: progress shows its replicates, where their number is known before.
  const bool whole_lines = options.exact || (options.shared_facets && table.stderr_target > 0.0);
  const std::uint64_t steps = whole_lines ? 1 : options.shared_facets ? replicate_count : table.width();
  for_each_line(table, steps, monitor, job, [&](std::size_t y) {
    const std::size_t first = y * table.width();
    const Integrator& integrator = *integrators[y / table.lines_per_parameter()];
    const Direction wo = table.wo(first);
    std::vector<Direction> wi(table.width());
    for (std::size_t x = 0; x < wi.size(); ++x) wi[x] = table.wi(first + x);
    if (options.exact) {
      LineWriter line(table, first, wi.size());
      integrator.exact_row(wo, wi, line.replicate(0));
      line.store_exact();
    } else if (options.shared_facets) {
      sample_line(integrator, wi, wo, first, y, options, table, monitor, whole_lines ? 0 : 1);
    } else {
      for (std::size_t x = 0; x < wi.size(); ++x) {
        sample_line(integrator, {&wi[x], 1}, wo, first + x, first + x, options, table, monitor, 0);
        monitor.advance(1);
      }
    }
    if (whole_lines) monitor.advance(1);
  });
  return std::move(canvas.table);
}

Table render(const Model& model, const ParameterValues& values, std::vector<Axis> parameter_axes, const Grid& grid,
             Monitor& monitor, const RenderJob& job) {
  if (!is_hair(model.info->kind)) check_hemisphere(grid, std::string(model.info->name));
  Canvas canvas = make_canvas(values, std::move(parameter_axes), grid);
  Table& table = canvas.table;
  for (const ParameterInfo& info : values.list()) {
    const std::span<const double> slots = values.components(info);
    if (slots.size() == 3 && (slots[0] != slots[1] || slots[0] != slots[2])) table.channels = 3;
  }
  table.allocate();
  table.method = "exact";
  for_each_line(table, 1, monitor, job, [&](std::size_t y) {
    const std::span<const double> flat = canvas.rows[y / table.lines_per_parameter()].flat();
    for (std::size_t entry = y * table.width(); entry < (y + 1) * table.width(); ++entry) {
      store(table, entry, model.evaluate(flat, table.wi(entry), table.wo(entry)));
    }
    monitor.advance(1);
  });
  return std::move(canvas.table);
}

}  // namespace lobefit
