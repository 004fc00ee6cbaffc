#include "reference/albedo_difference.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <map>

#include "reference/half_vector_rule.h"

namespace lobefit {

namespace {

double sine(const Direction& w) { return std::hypot(w.x, w.y); }

/// Sums over the lights of one view.
class AlbedoSums {
 public:
  explicit AlbedoSums(int channels) : truth_(static_cast<std::size_t>(channels)), other_(truth_.size()) {}

  /// A light of which `known` tells whether both have a value; f and g are read if so.
  template <class F, class G>
  void add(double weight, bool known, F&& f, G&& g) {
    total_ += weight;
    if (!known) return;
    known_ += weight;
    for (std::size_t c = 0; c < truth_.size(); ++c) {
      truth_[c] += weight * f(c);
      other_[c] += weight * g(c);
    }
  }
  /// `whole` is what all weights would sum to if the lights covered the hemisphere; 0 if they do.
  std::optional<AlbedoAtAngle> at(std::size_t row, double theta_o, double whole) const {
    const double coverage = known_ / (whole > 0.0 ? whole : total_);
    if (!(coverage >= least_coverage && coverage <= most_coverage)) return std::nullopt;
    AlbedoAtAngle result{row, theta_o, truth_, other_, coverage};
    for (double& value : result.truth) value *= pi / known_;
    for (double& value : result.other) value *= pi / known_;
    return result;
  }

 private:
  std::vector<double> truth_, other_;
  double total_ = 0.0, known_ = 0.0;
};

using Angles = std::vector<std::optional<AlbedoAtAngle>>;

/// On a grid of angles, by its own quadrature: each view of the grid is one.
Angles albedos_on_grid(const BrdfPair& pair, const std::vector<double>& quadrature) {
  const Table& table = *pair.table;
  const std::vector<double> weights_o = table.grid.theta_o.weights();
  double azimuths = 0.0;
  for (const double weight : table.grid.phi.weights()) azimuths += weight;
  Angles angles(table.height());
  for (std::size_t line = 0; line < angles.size(); ++line) {
    AlbedoSums sums(table.channels);
    const std::size_t view = line % table.lines_per_parameter();
    for (std::size_t entry = line * table.width(); entry < (line + 1) * table.width(); ++entry) {
      const Direction wi = table.wi(entry);
      const auto value = [&](const auto& values) {
        return [&values, &table, entry](std::size_t c) { return double{values[c * table.entries() + entry]}; };
      };
      sums.add(quadrature[entry] / weights_o[view] * sine(wi) * wi.z, table.valid[entry] != 0, value(table.values),
               value(pair.values));
    }
    const double whole = 0.5 * 180.0 / pi * azimuths / azimuth_share(table.grid.phi);
    angles[line] = sums.at(line / table.lines_per_parameter(), table.grid.theta_o.values[view], whole);
  }
  return angles;
}

/// Over entries that have one view angle, where a list has rings of them.
Angles albedos_on_rings(const BrdfPair& pair, const std::vector<double>& quadrature) {
  const Table& table = *pair.table;
  std::map<std::pair<std::size_t, long>, AlbedoSums> rings;  // by parameter row and hundredths of a degree
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    const Direction wi = table.wi(entry), wo = table.wo(entry);
    if (!(wi.z > 0.0 && wo.z > 0.0)) continue;
    const long ring = std::lround(100.0 * degrees(std::atan2(sine(wo), wo.z)));
    const auto value = [&](const auto& values) {
      return [&values, &table, entry](std::size_t c) { return double{values[c * table.entries() + entry]}; };
    };
    rings.try_emplace({table.parameter_row(entry), ring}, table.channels)
        .first->second.add(quadrature[entry] * measured_sine(wi) * measured_sine(wo) * wi.z, table.valid[entry] != 0,
                           value(table.values), value(pair.values));
  }
  constexpr std::size_t most_rings = 180;  // more are scattered directions, of which each has a few lights
  Angles angles;
  if (rings.size() > most_rings * table.parameter_rows()) return angles;
  for (const auto& [ring, sums] : rings) {
    angles.push_back(sums.at(ring.first, 0.01 * static_cast<double>(ring.second), 0.0));
  }
  return angles;
}

/// At views of every ten degrees, from values at any directions.
Angles albedos_by_rule(const BrdfPair& pair) {
  const HalfVectorRule rule(2);
  constexpr std::size_t views = 9;
  const std::size_t rows = pair.table->parameter_rows();
  Angles angles(rows * views);
  tbb::parallel_for(std::size_t{0}, angles.size(), [&](std::size_t number) {
    const std::size_t row = number / views;
    const double theta_o = 10.0 * static_cast<double>(number % views);
    const Direction wo = direction(radians(theta_o), 0.0);
    AlbedoSums sums(pair.table->channels);
    for (const LightNode& node : rule.lights(wo)) {
      const std::optional<Rgb> f = pair.truth(row, node.wi, wo);
      const std::optional<Rgb> g = f ? pair.other(row, node.wi, wo) : std::nullopt;
      const auto channel = [](const std::optional<Rgb>& value) {
        return [&value](std::size_t c) { return c == 0 ? value->x : c == 1 ? value->y : value->z; };
      };
      sums.add(node.weight * node.wi.z, g.has_value(), channel(f), channel(g));
    }
    angles[number] = sums.at(row, theta_o, pi);
  });
  return angles;
}

/// Worst and mean over angles and channels, by the quadrature weights of each row's angles.
template <class Error>
std::optional<WorstAndMean> summarise(const std::vector<AlbedoAtAngle>& angles, Error&& error_of) {
  double worst = 0.0, sum = 0.0, total = 0.0;
  for (std::size_t begin = 0; begin < angles.size();) {
    std::size_t end = begin;
    Axis axis;
    for (; end < angles.size() && angles[end].row == angles[begin].row; ++end) {
      axis.values.push_back(angles[end].theta_o);
    }
    const std::vector<double> weights = axis.weights();
    for (std::size_t k = begin; k < end; ++k) {
      for (std::size_t c = 0; c < angles[k].truth.size(); ++c) {
        const std::optional<double> error = error_of(angles[k], c);
        if (!error) continue;
        worst = std::max(worst, *error);
        sum += weights[k - begin] * *error;
        total += weights[k - begin];
      }
    }
    begin = end;
  }
  if (!(total > 0.0)) return std::nullopt;
  return WorstAndMean{worst, sum / total};
}

}  // namespace

std::optional<double> AlbedoAtAngle::relative(std::size_t channel) const {
  if (!(truth[channel] > 0.0)) return std::nullopt;
  return absolute(channel) / truth[channel];
}

double azimuth_share(const Axis& phi) {
  double span = 0.0;
  for (const double weight : phi.weights()) span += weight;
  return span / (span > 181.0 ? 360.0 : 180.0);
}

std::optional<AlbedoDifference> albedo_difference(const BrdfPair& pair, const std::vector<double>& quadrature) {
  AlbedoDifference result;
  Angles angles;
  if (pair.table->coordinates == Coordinates::spherical) {
    result.method = "grid";
    angles = albedos_on_grid(pair, quadrature);
  } else if (pair.truth && pair.other) {
    result.method = "half_vector";
    angles = albedos_by_rule(pair);
  } else if (pair.table->coordinates == Coordinates::list) {
    result.method = "rings";
    angles = albedos_on_rings(pair, quadrature);
  }
  for (std::optional<AlbedoAtAngle>& angle : angles) {
    if (angle) result.angles.push_back(std::move(*angle));
  }
  const auto absolute = summarise(result.angles, [](const AlbedoAtAngle& angle, std::size_t c) {
    return std::optional<double>(angle.absolute(c));
  });
  if (!absolute) return std::nullopt;
  result.absolute = *absolute;
  result.relative =
      summarise(result.angles, [](const AlbedoAtAngle& angle, std::size_t c) { return angle.relative(c); });
  return result;
}

}  // namespace lobefit
