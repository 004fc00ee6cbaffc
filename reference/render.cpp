#include "reference/render.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <functional>

namespace lobefit {

namespace {

/// A table with its axes and provenance, and the flat parameters of each of its rows.
struct Canvas {
  Table table;
  std::vector<std::vector<double>> rows;
};

Canvas make_canvas(const ParameterValues& values, std::vector<Axis> parameter_axes, const Grid& grid) {
  Canvas canvas;
  Table& table = canvas.table;
  table.grid = grid;
  table.parameter_axes = std::move(parameter_axes);
  table.model = values.owner();
  table.version = LOBEFIT_VERSION;
  table.parameters = Json::object();
  for (const Axis& axis : table.parameter_axes) {
    if (!values.info(axis.name).choices.empty()) {
      throw Error(ExitCode::usage, "parameter '" + axis.name + "' can't be an axis", values.owner(),
                  "it is a choice, not a number; render one table per choice with --set");
    }
  }
  for (const ParameterInfo& info : values.list()) {
    const bool is_axis = std::any_of(table.parameter_axes.begin(), table.parameter_axes.end(),
                                     [&](const Axis& axis) { return axis.name == info.name; });
    if (is_axis) continue;
    const std::span<const double> slots =
        values.flat().subspan(static_cast<std::size_t>(info.offset), static_cast<std::size_t>(info.components));
    if (!info.choices.empty()) {
      table.parameters[std::string(info.name)] = std::string(values.choice(info.name));
    } else if (info.components == 1) {
      table.parameters[std::string(info.name)] = slots[0];
    } else {
      table.parameters[std::string(info.name)] = std::vector<double>(slots.begin(), slots.end());
      if (slots[0] != slots[1] || slots[0] != slots[2]) table.channels = 3;
    }
  }
  for (std::size_t row = 0; row < table.parameter_rows(); ++row) {
    ParameterValues at_row = values;
    const std::vector<double> coordinates = table.parameter_values(row);
    for (std::size_t i = 0; i < coordinates.size(); ++i) at_row.set(table.parameter_axes[i].name, coordinates[i]);
    canvas.rows.emplace_back(at_row.flat().begin(), at_row.flat().end());
  }
  table.allocate();
  return canvas;
}

double channel_of(const Rgb& value, int channel) { return channel == 0 ? value.x : channel == 1 ? value.y : value.z; }

/// Stores one value; what is not a finite number is masked, never passed on.
void store(Table& table, std::size_t entry, const Rgb& value) {
  for (int c = 0; c < table.channels; ++c) {
    const double v = channel_of(value, c);
    table.values[static_cast<std::size_t>(c) * table.entries() + entry] = static_cast<float>(v);
    if (!std::isfinite(static_cast<float>(v))) table.valid[entry] = 0;
  }
}

/// Runs `line(y)` for every line of the table. Lines are independent, so threads can't change the bits.
void for_each_line(const Table& table, Monitor& monitor, const std::function<void(std::size_t)>& line) {
  monitor.begin("render " + table.model, table.height());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, table.height(), 1), [&](const auto& range) {
    for (std::size_t y = range.begin(); y < range.end(); ++y) {
      monitor.check();
      line(y);
      monitor.advance(1);
    }
  });
  monitor.end();
}

/// One line by Monte Carlo: entries [first, first + wi.size()).
void sample_line(const Reference& reference, std::span<const double> flat, std::span<const Direction> wi,
                 const Direction& wo, std::size_t first, std::uint64_t key, const RenderOptions& options, Table& table,
                 Monitor& monitor) {
  const std::size_t n = wi.size();
  std::vector<Rgb> means(n * replicate_count);
  for (SamplingOptions sampling = options.sampling;; sampling.samples *= 2) {
    for (std::uint32_t r = 0; r < replicate_count; ++r) {
      monitor.check();
      reference.sample_row(flat, wo, wi, SamplePoints(sampling.sampler, {sampling.seed, key, r}),
                           sampling.per_replicate(), options.shared_facets, std::span(means).subspan(r * n, n));
    }
    double worst = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      Rgb mean;
      for (int c = 0; c < table.channels; ++c) {
        std::array<double, replicate_count> column;
        for (std::size_t r = 0; r < replicate_count; ++r) column[r] = channel_of(means[r * n + j], c);
        const MeanAndError result = mean_and_error(std::span<const double>(column));
        (c == 0 ? mean.x : c == 1 ? mean.y : mean.z) = result.mean;
        const std::size_t slot = static_cast<std::size_t>(c) * table.entries() + first + j;
        table.stderr_values[slot] = static_cast<float>(result.standard_error);
        if (!table.replicates.empty()) {
          for (std::size_t r = 0; r < replicate_count; ++r) {
            table.replicates[r * table.values.size() + slot] = static_cast<float>(column[r]);
          }
        }
        worst = max(worst, result.standard_error);
      }
      store(table, first + j, mean);
    }
    if (sampling.stderr_target > 0.0 && worst > sampling.stderr_target && sampling.samples * 2 <= most_samples)
      continue;
    if (!table.sample_counts.empty()) {
      const auto count = static_cast<float>(std::uint64_t{sampling.per_replicate()} * replicate_count);
      std::fill_n(table.sample_counts.begin() + static_cast<std::ptrdiff_t>(first), n, count);
    }
    return;
  }
}

}  // namespace

Table render(const Reference& reference, const ParameterValues& values, std::vector<Axis> parameter_axes,
             const Grid& grid, const RenderOptions& options, Monitor& monitor) {
  Canvas canvas = make_canvas(values, std::move(parameter_axes), grid);
  Table& table = canvas.table;
  table.method = options.exact ? "exact" : "monte_carlo";
  if (!options.exact) {
    table.seed = options.sampling.seed;
    table.samples = std::uint64_t{options.sampling.per_replicate()} * replicate_count;
    table.shared_facets = options.shared_facets;
    if (options.sampling.stderr_target > 0.0) table.sample_counts.assign(table.entries(), 0.0f);
    if (options.shared_facets) table.replicates.assign(table.values.size() * replicate_count, 0.0f);
  }
  for_each_line(table, monitor, [&](std::size_t y) {
    const std::size_t first = y * table.width();
    const std::vector<double>& flat = canvas.rows[y / table.lines_per_parameter()];
    const Direction wo = table.wo(first);
    std::vector<Direction> wi(table.width());
    for (std::size_t x = 0; x < wi.size(); ++x) wi[x] = table.wi(first + x);
    if (options.exact) {
      for (std::size_t x = 0; x < wi.size(); ++x) store(table, first + x, reference.exact(flat, wi[x], wo));
    } else if (options.shared_facets) {
      sample_line(reference, flat, wi, wo, first, y, options, table, monitor);
    } else {
      for (std::size_t x = 0; x < wi.size(); ++x) {
        sample_line(reference, flat, {&wi[x], 1}, wo, first + x, first + x, options, table, monitor);
      }
    }
  });
  return std::move(canvas.table);
}

Table render(const Model& model, const ParameterValues& values, std::vector<Axis> parameter_axes, const Grid& grid,
             Monitor& monitor) {
  Canvas canvas = make_canvas(values, std::move(parameter_axes), grid);
  Table& table = canvas.table;
  table.method = "exact";
  for_each_line(table, monitor, [&](std::size_t y) {
    const std::vector<double>& flat = canvas.rows[y / table.lines_per_parameter()];
    for (std::size_t entry = y * table.width(); entry < (y + 1) * table.width(); ++entry) {
      store(table, entry, model.evaluate(flat, table.wi(entry), table.wo(entry)));
    }
  });
  return std::move(canvas.table);
}

}  // namespace lobefit
