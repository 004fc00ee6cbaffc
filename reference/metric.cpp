#include "reference/metric.h"

#include <algorithm>
#include <numeric>

#include "models/error.h"

namespace lobefit {

namespace {

template <std::size_t N>
std::size_t index_of(std::string_view name, const std::array<std::string_view, N>& names, const char* what) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  std::string choices;
  for (const std::string_view choice : names) choices += (choices.empty() ? "" : ", ") + std::string(choice);
  throw Error(ExitCode::usage, "unknown " + std::string(what) + " '" + std::string(name) + "'", "",
              "choose from " + choices);
}

}  // namespace

Quantity parse_quantity(std::string_view name) {
  return static_cast<Quantity>(index_of(name, quantity_names, "metric"));
}

ValueAndSlope transform(Quantity quantity, double f, double cos_theta_i) {
  switch (quantity) {
    case Quantity::cosine: return {pi * f * cos_theta_i, pi * cos_theta_i};
    case Quantity::brdf: return {pi * f, pi};
    case Quantity::log: {
      // Measured values may be slightly negative; below zero the logarithm goes on as its tangent.
      const double x = f * cos_theta_i;
      return x > 0.0 ? ValueAndSlope{std::log1p(x), cos_theta_i / (1.0 + x)} : ValueAndSlope{x, cos_theta_i};
    }
    case Quantity::cube_root: {
      const double root = std::cbrt(f * cos_theta_i);
      // The slope is infinite at 0; black entries should not steer a fit.
      return {root, root != 0.0 ? cos_theta_i / (3.0 * root * root) : 0.0};
    }
  }
  return {};
}

std::vector<WeightFactor> parse_weights(std::string_view text) {
  std::vector<WeightFactor> factors;
  if (text == "uniform") return factors;
  std::size_t begin = 0;
  while (true) {
    const std::size_t comma = text.find(',', begin);
    factors.push_back(
        static_cast<WeightFactor>(index_of(text.substr(begin, comma - begin), weight_factor_names, "weight")));
    if (comma == std::string_view::npos) return factors;
    begin = comma + 1;
  }
}

std::vector<double> entry_weights(const Table& table, const std::vector<WeightFactor>& factors, Quantity quantity) {
  const bool wants_quadrature = std::find(factors.begin(), factors.end(), WeightFactor::quadrature) != factors.end();
  const std::vector<double> quadrature = wants_quadrature ? table.quadrature_weights() : std::vector<double>();
  const bool spherical = table.coordinates == Coordinates::spherical;
  std::vector<double> weights(table.entries(), 0.0);
  for (std::size_t entry = 0; entry < weights.size(); ++entry) {
    if (!table.valid[entry]) continue;
    const std::size_t i = table.theta_i_index(entry), o = table.theta_o_index(entry);
    const auto polar = [](const Direction& w) { return std::atan2(std::hypot(w.x, w.y), w.z); };
    const double theta_i = spherical ? radians(table.grid.theta_i.values[i]) : polar(table.wi(entry));
    const double theta_o = spherical ? radians(table.grid.theta_o.values[o]) : polar(table.wo(entry));
    double weight = 1.0;
    for (const WeightFactor factor : factors) {
      switch (factor) {
        case WeightFactor::sin_theta_i: weight *= std::sin(theta_i); break;
        case WeightFactor::sin_theta_o: weight *= std::sin(theta_o); break;
        case WeightFactor::cos_theta_i: weight *= std::cos(theta_i); break;
        case WeightFactor::cos_theta_o: weight *= std::cos(theta_o); break;
        case WeightFactor::quadrature: weight *= quadrature[entry]; break;
        case WeightFactor::inverse_variance: {
          double variance = 0.0;
          for (int c = 0; c < table.channels; ++c) {
            const double slope = transform(quantity, table.value(entry, c), std::cos(theta_i)).slope;
            const double error = slope * table.standard_error(entry, c);
            variance += error * error / table.channels;
          }
          if (variance <= 0.0) {
            throw Error(ExitCode::invalid_input, "weights by inverse variance, but an entry has no error",
                        "entry " + std::to_string(entry), "use other weights, or a Monte Carlo table");
          }
          weight /= variance;
          break;
        }
      }
    }
    weights[entry] = weight;
  }
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!(sum > 0.0)) {
    throw Error(ExitCode::invalid_input, "no entry carries weight", "",
                "every entry is masked, or lies where its weight is zero");
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

double rms_difference(const Table& table, std::span<const float> values, Quantity quantity,
                      const std::vector<double>& weights) {
  double sum = 0.0;
  for (int c = 0; c < table.channels; ++c) {
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      if (weights[entry] == 0.0) continue;
      const double cos_theta_i = table.wi(entry).z;
      const double other = values[static_cast<std::size_t>(c) * table.entries() + entry];
      const double difference =
          transform(quantity, other, cos_theta_i).value - transform(quantity, table.value(entry, c), cos_theta_i).value;
      sum += weights[entry] * difference * difference;
    }
  }
  return std::sqrt(sum / table.channels);
}

QuantityErrors rms_differences(const Table& table, std::span<const float> values, const std::vector<double>& weights) {
  QuantityErrors sums{};
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (weights[entry] == 0.0) continue;
    const double cos_theta_i = table.wi(entry).z;
    for (int c = 0; c < table.channels; ++c) {
      const double other = values[static_cast<std::size_t>(c) * table.entries() + entry], truth = table.value(entry, c);
      for (std::size_t q = 0; q < sums.size(); ++q) {
        const auto quantity = static_cast<Quantity>(q);
        sums[q] += weights[entry] * square(transform(quantity, other, cos_theta_i).value -
                                           transform(quantity, truth, cos_theta_i).value);
      }
    }
  }
  for (double& sum : sums) sum = std::sqrt(sum / table.channels);
  return sums;
}

}  // namespace lobefit
