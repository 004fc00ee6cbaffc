#include "fit/hops.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "reference/sample_points.h"

namespace lobefit {

namespace {

using Names = std::vector<std::string>;

constexpr int most_rounds = 6;
constexpr double least_gain = 1e-4;  // of the sum of squares; less is a matter of when a descent stops
/// Places that a lobe, and each of a pair of lobes, starts anew from.
constexpr std::uint32_t single_draws = 4, pair_draws = 2;

/// Two numbers in (0, 1) of a variable.
std::array<double, 2> draw(std::uint64_t seed, std::size_t variable, std::uint32_t index) {
  return SamplePoints(Sampler::philox, {seed, variable, own_stream})(index);
}

bool holds(const Names& names, std::string_view name) { return std::ranges::find(names, name) != names.end(); }

/// A second specular lobe starts anew together with the first one: the two change places, or the second one becomes
/// narrow enough to feel its scale, or both are split in another way.
void split_anew(const FitVariables& variables, std::vector<double>& x, std::uint64_t seed, std::uint32_t index) {
  const auto variable = [&](std::string_view name) {
    const auto found = std::ranges::find(variables.parameters, name);
    return static_cast<std::size_t>(found - variables.parameters.begin());
  };
  const std::size_t alpha = variable("alpha"), scale = variable("dual_specular_roughness_scale"),
                    opacity = variable("dual_specular_opacity");
  if (std::max({alpha, scale, opacity}) == variables.parameters.size()) return;
  const double second_alpha = std::min(1.0, x[alpha] * x[scale] * x[scale]);
  switch (index % 3) {
    case 0:
      x[opacity] = 1.0 - x[opacity];
      x[scale] = std::sqrt(x[alpha] / std::max(second_alpha, 1e-9));
      x[alpha] = second_alpha;
      break;
    case 1: x[scale] = 0.85 / std::sqrt(std::max(x[alpha], 1e-9)); break;
    default:
      x[alpha] *= 0.4 + 0.6 * draw(seed, alpha, index)[0];
      x[scale] = 1.3 + 1.5 * draw(seed, scale, index)[0];
      x[opacity] = 0.15 + 0.6 * draw(seed, opacity, index)[0];
  }
}

/// `x` with the variables of a lobe anywhere in their ranges.
std::vector<double> start_anew(const FitVariables& variables, const Names& lobe, std::vector<double> x,
                               std::uint64_t seed, std::uint32_t index) {
  const bool splits = holds(lobe, "dual_specular_opacity");
  if (splits) split_anew(variables, x, seed, index);
  double sign = 0.0;  // of a product: all channels keep to one side
  for (std::size_t v = 0; v < x.size(); ++v) {
    const std::string& name = variables.parameters[v];
    if (!holds(lobe, name) || (splits && name.starts_with("dual_specular"))) continue;
    // Channels of a colour start alike.
    std::size_t first = v;
    while (first > 0 && variables.parameters[first - 1] == name) --first;
    const double u = draw(seed, first, index)[0], range = variables.upper[v] - variables.lower[v];
    if (variables.lower[v] < 0.0) {
      // Every other time on the other side of 0.
      if (v == first) sign = (x[v] > 0.0) == (index % 2 == 0) ? -1.0 : 1.0;
      x[v] = sign * (0.2 + 0.5 * u) * variables.upper[v];
    } else {
      // An intensity's range is far wider than what it is used for.
      x[v] = range > 16.0 ? std::pow(4.0, 2.0 * u - 1.0) : variables.lower[v] + (0.1 + 0.8 * u) * range;
    }
  }
  for (std::size_t v = 0; v < x.size(); ++v) x[v] = std::clamp(x[v], variables.lower[v], variables.upper[v]);
  return x;
}

/// The shortest of the parameters' names that `name` begins with.
std::string_view root_of(std::string_view name, const ParameterValues& values) {
  std::string_view root = name;
  for (const ParameterInfo& info : values.list()) {
    if (info.name.size() < root.size() && name.starts_with(info.name) && name[info.name.size()] == '_')
      root = info.name;
  }
  return root;
}

}  // namespace

std::vector<Names> lobes_of(const ParameterValues& values) {
  std::vector<std::string_view> roots;
  std::vector<Names> lobes;
  for (const ParameterInfo& info : values.list()) {
    const std::string_view root = root_of(info.name, values);
    const auto place = static_cast<std::size_t>(std::ranges::find(roots, root) - roots.begin());
    if (place == roots.size()) {
      roots.push_back(root);
      lobes.emplace_back();
    }
    lobes[place].emplace_back(info.name);
  }
  std::erase_if(lobes, [](const Names& names) { return names.size() < 2; });
  return lobes;
}

Minimum hop(const FitVariables& variables, const ParameterValues& values, Minimum best, std::uint64_t seed,
            const Descend& descend) {
  std::vector<Names> lobes = lobes_of(values);
  std::erase_if(lobes, [&](const Names& lobe) {
    return std::ranges::none_of(variables.parameters, [&](const std::string& name) { return holds(lobe, name); });
  });
  std::vector<Names> pairs;  // that may have gone astray together
  for (std::size_t a = 0; a < lobes.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      pairs.push_back(lobes[a]);
      pairs.back().insert(pairs.back().end(), lobes[b].begin(), lobes[b].end());
    }
  }
  std::uint32_t index = 0;
  const auto gains = [&](const std::vector<Names>& groups, std::uint32_t draws) {
    std::vector<Minimum> found(groups.size() * draws);
    tbb::parallel_for(std::size_t{0}, found.size(), [&](std::size_t k) {
      const auto which = index + static_cast<std::uint32_t>(k % draws);
      found[k] = descend(start_anew(variables, groups[k / draws], best.x, seed, which));
    });
    index += draws;
    const auto lowest = std::ranges::min_element(found, {}, &Minimum::sum_of_squares);
    if (lowest == found.end() || !(lowest->sum_of_squares < (1.0 - least_gain) * best.sum_of_squares)) return false;
    best = *lowest;
    return true;
  };
  for (int round = 0; round < most_rounds; ++round) {
    if (!gains(lobes, single_draws) && !gains(pairs, pair_draws)) break;
  }
  return best;
}

}  // namespace lobefit
