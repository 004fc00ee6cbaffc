#include "evaluate/check.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>

#include "evaluate/conditioning.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

constexpr std::size_t block_size = 4096;

std::vector<float> rounded(std::span<const double> flat) {
  std::vector<float> result(flat.size());
  for (std::size_t i = 0; i < flat.size(); ++i) result[i] = static_cast<float>(flat[i]);
  return result;
}

std::array<double, 4> numbers(std::uint64_t seed, std::uint64_t pair, std::uint32_t purpose) {
  const auto first = SamplePoints(Sampler::philox, {seed, pair, purpose})(0);
  const auto second = SamplePoints(Sampler::philox, {seed, pair, purpose})(1);
  return {first[0], first[1], second[0], second[1]};
}

/// Uniform over the hemisphere; every eighth pair is hostile.
void set_pair(FloatPairs& pairs, std::size_t i, std::uint64_t seed) {
  const auto u = numbers(seed, i, 0);
  const auto up = [](double z, double turn) {
    const double radius = std::sqrt(1.0 - z * z);
    return Direction{radius * std::cos(2.0 * pi * turn), radius * std::sin(2.0 * pi * turn), z};
  };
  Direction wi = up(u[0], u[1]), wo = up(u[2], u[3]);
  if (i % 8 == 0) {
    switch (i / 8 % 4) {
      case 0: wi = up(1e-4 * u[0] + 1e-6, u[1]); break;                          // light at grazing angles
      case 1: wo = up(1e-4 * u[2] + 1e-6, u[3]); break;                          // view at grazing angles
      case 2: wo = i / 32 % 2 == 0 ? wi : Direction{-wi.x, -wi.y, wi.z}; break;  // retro, mirror
      case 3: (i / 32 % 2 == 0 ? wi : wo) = {0.0, 0.0, 1.0}; break;
    }
  }
  pairs.set(i, wi, wo);
}

/// Error sums of one block, added up in block order.
struct BlockErrors {
  double squares = 0.0, relative_squares = 0.0, max_abs = 0.0, max_rel = 0.0, worst_excess = 0.0;
  std::uint64_t relative_count = 0, conditioned = 0, failures = 0, non_finite = 0;
  std::size_t worst = 0;
};

}  // namespace

std::vector<ParameterValues> varied_parameters(const ParameterValues& values, const std::vector<std::string>& vary,
                                               int count, std::uint64_t seed) {
  std::vector<ParameterValues> sets{values};
  while (static_cast<int>(sets.size()) < count && !vary.empty()) {
    ParameterValues set = values;
    for (std::size_t k = 0; k < vary.size(); ++k) {
      const ParameterInfo& info = set.info(vary[k]);
      const auto u = numbers(seed, sets.size() * 64 + k, 1);
      const double where = u[0] < 0.15 ? 0.0 : u[0] > 0.85 ? 1.0 : u[1];
      const double value = info.lower + where * (info.upper - info.lower);
      set.set(info.name, info.choices.empty() ? value : std::round(value));
    }
    sets.push_back(std::move(set));
  }
  return sets;
}

CheckResult check_model(const Model& model, const std::vector<ParameterValues>& parameter_sets,
                        const CheckOptions& options, const FloatDevice& device, Monitor& monitor) {
  const std::size_t n = options.pairs, blocks = (n + block_size - 1) / block_size;
  ParameterBlocks parameters{.sets = {}, .block_size = block_size};
  for (const ParameterValues& set : parameter_sets) parameters.sets.push_back(rounded(set.flat()));

  monitor.begin("check " + std::string(model.info->name), blocks);
  FloatPairs pairs(n);
  const bool hair = is_hair(model.info->kind);
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t i) {
    set_pair(pairs, i, options.seed);
    if (hair && (i + i / 64) % 2 == 1) pairs.wi_z[i] = -pairs.wi_z[i];
  });

  FloatRgb values(n);
  const double seconds = device.evaluate(model, parameters, pairs, values);

  std::vector<float> relative(n, -1.0f);
  std::vector<BlockErrors> errors(blocks);
  tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
    monitor.check();
    BlockErrors& e = errors[block];
    const std::vector<float>& set = parameters.sets[parameters.set_of(block * block_size)];
    const std::vector<double> flat(set.begin(), set.end());
    e.worst = block * block_size;
    for (std::size_t i = block * block_size; i < std::min(n, (block + 1) * block_size); ++i) {
      const Rgb truth = model.evaluate(flat, pairs.wi(i), pairs.wo(i));
      const std::array<double, 3> expected{truth.x, truth.y, truth.z};
      const std::array<float, 3> found{values.r[i], values.g[i], values.b[i]};
      // f of a fibre carries its own cosine.
      const double cos_theta_i = hair ? 1.0 : std::abs(pairs.wi(i).z);
      bool failed = false;
      std::optional<std::array<double, 3>> conditioning;
      for (std::size_t c = 0; c < 3; ++c) {
        if (!std::isfinite(found[c]) || !std::isfinite(expected[c])) {
          ++e.non_finite;
          e.worst_excess = std::numeric_limits<double>::infinity();
          e.worst = i;
          failed = true;
          continue;
        }
        const double error = std::abs(found[c] - expected[c]);
        double bound = options.relative_bound * std::abs(expected[c]) + options.absolute_bound / cos_theta_i;
        if (error > bound) {
          if (!conditioning) conditioning = float_conditioning(model, flat, pairs.wi(i), pairs.wo(i));
          bound += (*conditioning)[c];
        }
        const double excess = error / bound;
        e.squares += error * error;
        e.max_abs = max(e.max_abs, error);
        if (std::abs(expected[c]) >= smallest_relative_value) {
          const double ratio = error / std::abs(expected[c]);
          e.relative_squares += ratio * ratio;
          ++e.relative_count;
          e.max_rel = max(e.max_rel, ratio);
          relative[i] = std::max(relative[i], static_cast<float>(ratio));
        }
        failed = failed || excess > 1.0;
        if (excess > e.worst_excess) {
          e.worst_excess = excess;
          e.worst = i;
        }
      }
      e.failures += failed ? 1 : 0;
      e.conditioned += conditioning && !failed ? 1 : 0;
    }
    monitor.advance(1);
  });
  monitor.end();

  CheckResult result;
  result.device = device.name();
  result.language = device.language();
  result.software = device.software();
  result.model = std::string(model.info->name);
  result.pairs = n;
  BlockErrors total;
  for (const BlockErrors& e : errors) {
    total.squares += e.squares;
    total.relative_squares += e.relative_squares;
    total.relative_count += e.relative_count;
    total.conditioned += e.conditioned;
    total.failures += e.failures;
    total.non_finite += e.non_finite;
    total.max_abs = max(total.max_abs, e.max_abs);
    total.max_rel = max(total.max_rel, e.max_rel);
    if (e.worst_excess > total.worst_excess) {
      total.worst_excess = e.worst_excess;
      total.worst = e.worst;
    }
  }
  result.max_abs = total.max_abs;
  result.max_rel = total.max_rel;
  result.rms = std::sqrt(total.squares / (3.0 * static_cast<double>(n)));
  result.rms_rel =
      total.relative_count > 0 ? std::sqrt(total.relative_squares / static_cast<double>(total.relative_count)) : 0.0;
  std::erase_if(relative, [](float r) { return r < 0.0f; });
  if (!relative.empty()) {
    const auto rank = relative.begin() + static_cast<std::ptrdiff_t>(0.999 * static_cast<double>(relative.size() - 1));
    std::nth_element(relative.begin(), rank, relative.end());
    result.p999_rel = *rank;
  }
  result.conditioned = total.conditioned;
  result.failures = total.failures;
  result.non_finite = total.non_finite;
  result.worst_wi = pairs.wi(total.worst);
  result.worst_wo = pairs.wo(total.worst);
  result.worst_parameters = parameter_sets[parameters.set_of(total.worst)];
  result.evaluations_per_s = static_cast<double>(n) / seconds;
  result.passed = result.failures == 0;
  return result;
}

CheckTable check_against_table(const TableModel& on_table, const Table& table, const FloatDevice& device) {
  ParameterBlocks parameters{.sets = {}, .block_size = table.entries() / table.parameter_rows()};
  for (std::size_t row = 0; row < table.parameter_rows(); ++row) {
    parameters.sets.push_back(rounded(on_table.row(row)));
  }
  FloatPairs pairs(table.entries());
  for (std::size_t entry = 0; entry < table.entries(); ++entry) pairs.set(entry, table.wi(entry), table.wo(entry));
  FloatRgb values(table.entries());
  device.evaluate(on_table.model(), parameters, pairs, values);
  std::vector<float> planes(values.r);
  if (table.channels == 3) {
    planes.insert(planes.end(), values.g.begin(), values.g.end());
    planes.insert(planes.end(), values.b.begin(), values.b.end());
  }
  const std::vector<double> weights = entry_weights(table, {}, Quantity::cosine);
  return {rms_difference(table, on_table.render().values, Quantity::cosine, weights),
          rms_difference(table, planes, Quantity::cosine, weights)};
}

Json CheckResult::json() const {
  Json parameters = Json::object();
  for (const ParameterInfo& info : worst_parameters.list()) {
    parameters[std::string(info.name)] = worst_parameters.text(info);
  }
  // Vectors, since degrees would lose the bits that made them the worst.
  const auto vector = [](const Direction& w) { return Json{w.x, w.y, w.z}; };
  const auto angles = [](const Direction& w) { return Json{degrees(std::acos(w.z)), degrees(std::atan2(w.y, w.x))}; };
  Json document{{"device", device},
                {"software", software},
                {"model", model},
                {"pairs", pairs},
                {"max_abs", max_abs},
                {"max_rel", max_rel},
                {"p999_rel", p999_rel},
                {"rms", rms},
                {"rms_rel", rms_rel},
                {"conditioned", conditioned},
                {"failures", failures},
                {"non_finite", non_finite},
                {"worst",
                 {{"wi", angles(worst_wi)},
                  {"wo", angles(worst_wo)},
                  {"wi_vector", vector(worst_wi)},
                  {"wo_vector", vector(worst_wo)},
                  {"params", parameters}}},
                {"evaluations_per_s", evaluations_per_s}};
  if (!language.empty()) document["language"] = language;
  if (table) document["table"] = {{"rms_double", table->rms_double}, {"rms_float", table->rms_float}};
  document["passed"] = passed;
  return document;
}

}  // namespace lobefit
