#include "fit/sample_entries.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fit/table_problem.h"
#include "reference/sample_points.h"

namespace lobefit {

namespace {

/// Entries at the mirror direction are so many times as likely as others, in a lobe of this GGX alpha.
constexpr double spike_share = 1000.0, spike_alpha = 0.015;

}  // namespace

EntrySampler::EntrySampler(const Table& table, const std::vector<double>& weights, Quantity quantity)
    : weights_(weights),
      importance_(weights.size(), 0.0),
      with_weight_(static_cast<std::size_t>(std::ranges::count_if(weights, [](double w) { return w > 0.0; }))) {
  std::vector<double> witness(weights.size());
  double mean = 0.0;
  for (std::size_t entry = 0; entry < weights.size(); ++entry) {
    if (weights[entry] == 0.0) continue;
    const Direction wi = table.wi(entry), sum = wi + table.wo(entry);
    double most = 0.0;
    for (int c = 0; c < table.channels; ++c)
      most = std::max(most, std::abs(transform(quantity, table.value(entry, c), wi.z).value));
    importance_[entry] = most;
    mean += weights[entry] * most;
    // Next to the mirror direction a model may have a spike that the data lack: without witnesses there, a fit would
    // make use of it.
    const double tangent2 = (sum.x * sum.x + sum.y * sum.y) / square(std::max(sum.z, 1e-9));
    witness[entry] = spike_share / square(1.0 + tangent2 / square(spike_alpha));
  }
  for (std::size_t entry = 0; entry < weights.size(); ++entry) {
    importance_[entry] = weights[entry] * (mean > 0.0 ? importance_[entry] + mean * (1.0 + witness[entry]) : 1.0);
  }
}

std::vector<double> EntrySampler::sample(std::size_t count, std::uint64_t seed) const {
  if (with_weight_ <= count) return weights_;
  // Probabilities are at most 1; what is cut off goes to the others.
  double factor = 0.0;
  for (int pass = 0; pass < 20; ++pass) {
    double certain = 0.0, rest = 0.0;
    for (const double i : importance_) {
      if (factor * i >= 1.0)
        certain += 1.0;
      else
        rest += i;
    }
    const double next = rest > 0.0 ? (static_cast<double>(count) - certain) / rest : factor;
    if (next <= factor) break;
    factor = next;
  }
  std::vector<double> sampled(weights_.size(), 0.0);
  double position = SamplePoints(Sampler::philox, {seed, weights_.size(), own_stream})(1)[0];
  for (std::size_t entry = 0; entry < weights_.size(); ++entry) {
    const double probability = std::min(1.0, factor * importance_[entry]);
    if (probability == 0.0) continue;
    const double before = position;
    position += probability;
    if (std::floor(position) > std::floor(before)) sampled[entry] = weights_[entry] / probability;
  }
  const double sum = std::accumulate(sampled.begin(), sampled.end(), 0.0);
  for (double& weight : sampled) weight /= sum;
  return sampled;
}

}  // namespace lobefit
