#include "reference/brdf_difference.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "models/error.h"
#include "reference/references.h"

namespace lobefit {

namespace {

enum Weighting { uniform, solid_angle };

/// Sums over entries and channels.
struct EntrySums {
  std::array<double, 2> weight{};
  std::array<std::array<double, quantity_names.size()>, 2> squares{};
  std::array<double, 2> absolute_log{}, smape{};
  double cosines = 0.0, differences = 0.0, truth = 0.0;  // by solid angle and both cosines

  EntrySums& operator+=(const EntrySums& other) {
    for (const Weighting w : {uniform, solid_angle}) {
      weight[w] += other.weight[w];
      for (std::size_t q = 0; q < squares[w].size(); ++q) squares[w][q] += other.squares[w][q];
      absolute_log[w] += other.absolute_log[w];
      smape[w] += other.smape[w];
    }
    cosines += other.cosines;
    differences += other.differences;
    truth += other.truth;
    return *this;
  }
};

double sine(const Direction& w) { return std::hypot(w.x, w.y); }

/// By what quadrature_weights() sin theta_i sin theta_o is to be multiplied to give dω_i dω_o, in steradians squared.
double steradians(const Table& table) {
  const double cell = std::pow(pi / 180.0, 3);
  switch (table.coordinates) {
    case Coordinates::list: return 1.0;
    // The pair as a whole turns about the normal; light and view change places.
    case Coordinates::rusinkiewicz: return cell * 2.0 * pi * 2.0;
    case Coordinates::spherical: {
      double span = 0.0;
      for (const double weight : table.grid.phi.weights()) span += weight;
      return cell * 2.0 * pi * 360.0 * azimuth_share(table.grid.phi) / span;
    }
  }
  return 0.0;
}

EntrySums entry_sums(const BrdfPair& pair, const std::vector<double>& quadrature) {
  const Table& table = *pair.table;
  // Blocks of fixed size, added in order: the same bits for any number of threads.
  constexpr std::size_t block = 4096;
  std::vector<EntrySums> parts((table.entries() + block - 1) / block);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t number) {
    EntrySums sums;
    const std::size_t end = std::min(table.entries(), (number + 1) * block);
    for (std::size_t entry = number * block; entry < end; ++entry) {
      if (!table.valid[entry]) continue;
      const Direction wi = table.wi(entry), wo = table.wo(entry);
      const double solid = quadrature[entry] * sine(wi) * sine(wo);
      const std::array<double, 2> weights{1.0, solid};
      const double cosines = solid * std::abs(wi.z * wo.z);
      for (int c = 0; c < table.channels; ++c) {
        const double f = table.value(entry, c);
        const double g = pair.values[static_cast<std::size_t>(c) * table.entries() + entry];
        std::array<double, quantity_names.size()> differences;
        for (std::size_t q = 0; q < differences.size(); ++q) {
          const auto quantity = static_cast<Quantity>(q);
          differences[q] = transform(quantity, g, wi.z).value - transform(quantity, f, wi.z).value;
        }
        const double size = std::abs(f) + std::abs(g);
        for (const Weighting w : {uniform, solid_angle}) {
          sums.weight[w] += weights[w];
          for (std::size_t q = 0; q < differences.size(); ++q) {
            sums.squares[w][q] += weights[w] * square(differences[q]);
          }
          sums.absolute_log[w] += weights[w] * std::abs(differences[static_cast<std::size_t>(Quantity::log)]);
          if (size > 0.0) sums.smape[w] += weights[w] * std::abs(f - g) / size;
        }
        sums.cosines += cosines;
        sums.differences += cosines * std::abs(f - g);
        sums.truth += cosines * f;
      }
    }
    parts[number] = sums;
  });
  EntrySums sums;
  for (const EntrySums& part : parts) sums += part;
  return sums;
}

template <class T>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json();
}

}  // namespace

BrdfDifference brdf_difference(const BrdfPair& pair) {
  const Table& table = *pair.table;
  const std::vector<double> quadrature = table.quadrature_weights();
  const EntrySums sums = entry_sums(pair, quadrature);
  if (!(sums.weight[uniform] > 0.0)) {
    throw Error(ExitCode::invalid_input, "every entry is masked", "",
                "the two have no pair of directions in common: `lobefit table info` shows what each holds");
  }
  BrdfDifference result{.entries = table.entries() - table.masked()};
  const bool solid = sums.weight[solid_angle] > 0.0;
  const auto mean = [&](const std::array<double, 2>& sum) {
    EntryMean both{.uniform = sum[uniform] / sums.weight[uniform]};
    if (solid) both.solid_angle = sum[solid_angle] / sums.weight[solid_angle];
    return both;
  };
  for (std::size_t q = 0; q < quantity_names.size(); ++q) {
    EntryMean& rms = result.rms[q] = mean({sums.squares[uniform][q], sums.squares[solid_angle][q]});
    rms.uniform = std::sqrt(rms.uniform);
    if (rms.solid_angle) rms.solid_angle = std::sqrt(*rms.solid_angle);
  }
  result.mean_absolute_log = mean(sums.absolute_log);
  result.smape = mean(sums.smape);
  if (!solid) result.not_formed.push_back({"solid_angle", "no entry has a solid angle: all lie on the normal"});

  if (const std::optional<std::string> reason = no_hemisphere(table)) {
    result.not_formed.push_back({"bihemispherical", *reason});
    result.not_formed.push_back({"albedo", *reason});
    return result;
  }
  // Over Lambertian surfaces the cosines integrate to π².
  const double coverage =
      steradians(table) * sums.cosines / (pi * pi * table.channels * static_cast<double>(table.parameter_rows()));
  const bool covered = coverage >= least_coverage && coverage <= most_coverage;
  const std::string found =
      fmt::format("the entries' own quadrature finds {:.2g} of all pairs of directions", coverage);
  if (covered) {
    BihemisphericalDifference difference{.absolute = pi * pi * sums.differences / sums.cosines};
    if (sums.truth > 0.0) difference.relative = sums.differences / sums.truth;
    result.bihemispherical = difference;
  } else {
    result.not_formed.push_back({"bihemispherical", found});
  }
  // Rings divide a list's measure by itself, so that it has to be one.
  const bool anywhere = pair.truth && pair.other;
  if (table.coordinates != Coordinates::list || anywhere || covered) {
    result.albedo = albedo_difference(pair, quadrature);
  }
  if (!result.albedo) {
    result.not_formed.push_back(
        {"albedo", table.coordinates == Coordinates::spherical ? "no view has lights all over the hemisphere"
                   : anywhere                                  ? "no view has values all over the hemisphere"
                   : covered ? "one of the two has no values between its entries, and they are no rings of views"
                             : found});
  }
  return result;
}

std::optional<std::string> no_hemisphere(const Table& table) {
  const Reference* reference = find_reference_or_null(table.model);
  const bool fibre = (reference && reference->fibre) || std::ranges::any_of(models(), [&](const Model& model) {
                       return model.info->name == table.model && is_hair(model.info->kind);
                     });
  if (fibre) return "a fibre has no hemispheres";
  if (table.reaches_below()) return "the table reaches below the horizon";
  return std::nullopt;
}

Json row_json(const Table& table, std::size_t row) {
  const std::vector<double> values = table.parameter_values(row);
  Json json = Json::object();
  for (std::size_t k = 0; k < values.size(); ++k) json[table.parameter_axes[k].name] = values[k];
  return json;
}

Json BrdfDifference::json(const Table& table) const {
  Json document{{"entries", entries}};
  const auto both = [](const EntryMean& mean) {
    return Json{{"uniform", mean.uniform}, {"solid_angle", or_null(mean.solid_angle)}};
  };
  for (std::size_t q = 0; q < rms.size(); ++q) document["rms"][std::string(quantity_names[q])] = both(rms[q]);
  document["mean_absolute_log"] = both(mean_absolute_log);
  document["smape"] = both(smape);
  document["bihemispherical"] = nullptr;
  if (bihemispherical) {
    document["bihemispherical"] = {{"absolute", bihemispherical->absolute},
                                   {"relative", or_null(bihemispherical->relative)}};
  }
  document["albedo"] = nullptr;
  if (albedo) {
    const auto summary = [](const WorstAndMean& both_of) {
      return Json{{"worst", both_of.worst}, {"mean", both_of.mean}};
    };
    Json angles = Json::array();
    for (const AlbedoAtAngle& angle : albedo->angles) {
      Json absolute = Json::array(), relative = Json::array();
      for (std::size_t c = 0; c < angle.truth.size(); ++c) {
        absolute.push_back(angle.absolute(c));
        relative.push_back(or_null(angle.relative(c)));
      }
      Json line = row_json(table, angle.row);
      line.update({{"theta_o", angle.theta_o},
                   {"a", angle.truth},
                   {"b", angle.other},
                   {"absolute", absolute},
                   {"relative", relative},
                   {"coverage", angle.coverage}});
      angles.push_back(std::move(line));
    }
    document["albedo"] = {{"method", albedo->method},
                          {"absolute", summary(albedo->absolute)},
                          {"relative", albedo->relative ? summary(*albedo->relative) : Json()},
                          {"angles", angles}};
  }
  document["not_formed"] = Json::array();
  for (const NotFormed& missing : not_formed) {
    document["not_formed"].push_back({{"metric", missing.metric}, {"reason", missing.reason}});
  }
  return document;
}

}  // namespace lobefit
