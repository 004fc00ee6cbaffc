#include "fit/tiers.h"

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "fit/table_problem.h"

namespace lobefit {

namespace {

/// Squared differences of two fits from the table, summed per block of directions.
struct BlockSums {
  std::map<int, std::pair<double, double>> blocks;

  void add(const Table& table, const std::vector<double>& weights, const std::vector<float>& before,
           const std::vector<float>& after, Quantity quantity) {
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      if (weights[entry] == 0.0) continue;
      const Direction wi = table.wi(entry);
      auto& [lower, higher] = blocks[direction_block(wi, table.wo(entry))];
      for (int c = 0; c < table.channels; ++c) {
        const std::size_t at = static_cast<std::size_t>(c) * table.entries() + entry;
        const double truth = transform(quantity, table.values[at], wi.z).value;
        lower += weights[entry] * square(transform(quantity, before[at], wi.z).value - truth);
        higher += weights[entry] * square(transform(quantity, after[at], wi.z).value - truth);
      }
    }
  }
};

void compare(const TierFit& before, TierFit& after, const Table& table, const std::vector<double>& weights) {
  const auto rendered = [&](const Fit& fit) {
    return TableModel(find_model(fit.model), fit.values(), table, fit.mappings).render().values;
  };
  BlockSums sums;
  sums.add(table, weights, rendered(before.fit), rendered(after.fit), after.fit.options.quantity);
  double lower = 0.0, higher = 0.0;
  for (const auto& [block, pair] : sums.blocks) {
    lower += pair.first;
    higher += pair.second;
  }
  if (!(lower > 0.0)) return;
  const double ratio = higher / lower;
  double spread = 0.0;  // of the ratio of two sums over the same blocks
  for (const auto& [block, pair] : sums.blocks) spread += square(pair.second - ratio * pair.first);
  const auto count = static_cast<double>(sums.blocks.size());
  after.gain = 1.0 - ratio;
  after.gain_error = count > 1.0 ? std::sqrt(count / (count - 1.0) * spread) / lower : 0.0;
  after.decided = after.gain > 2.0 * after.gain_error;
}

}  // namespace

std::string TierFit::verdict(Tier before) const {
  const std::string text =
      fmt::format("{} takes {:.1f} ± {:.1f} % off {}'s mean square{}", tier_name(tier), 100.0 * gain,
                  100.0 * gain_error, tier_name(before), fit.holdout.empty() ? "" : " (held out)");
  return decided ? text
                 : text + fmt::format(": the data can't decide that {} is needed, prefer {}", tier_name(tier),
                                      tier_name(before));
}

std::vector<TierFit> fit_tiers(const Model& model, const ParameterValues& values, const Table& table,
                               const FitOptions& options, Tier highest, Monitor& monitor) {
  const HeldOut parts = held_out_weights(table, options);
  std::vector<TierFit> tiers;
  for (const Tier tier : {Tier::base, Tier::advanced, Tier::full}) {
    if (tier > highest) break;
    FitOptions of_tier = options;
    std::erase_if(of_tier.free, [&](const std::string& name) { return values.info(name).tier > tier; });
    if (of_tier.free.empty() || (!tiers.empty() && of_tier.free == tiers.back().fit.options.free)) continue;
    if (!tiers.empty()) of_tier.also_from.push_back(tiers.back().fit.values());
    TierFit next{.tier = tier, .fit = fit(model, values, table, of_tier, monitor)};
    if (!tiers.empty()) compare(tiers.back(), next, table, parts.held_out.empty() ? parts.fitted : parts.held_out);
    tiers.push_back(std::move(next));
  }
  return tiers;
}

Json tiers_json(const std::vector<TierFit>& tiers) {
  Json list = Json::array();
  for (std::size_t k = 0; k < tiers.size(); ++k) {
    const TierFit& tier = tiers[k];
    Json line{{"tier", tier_name(tier.tier)},
              {"free", tier.fit.solution.variables.size()},
              {"metrics", metrics_json(tier.fit.metrics)},
              {"holdout", metrics_json(tier.fit.holdout)}};
    if (k > 0) {
      line["gain"] = tier.gain;
      line["gain_stderr"] = tier.gain_error;
      line["decided"] = tier.decided;
      line["verdict"] = tier.verdict(tiers[k - 1].tier);
    }
    list.push_back(std::move(line));
  }
  return list;
}

}  // namespace lobefit
