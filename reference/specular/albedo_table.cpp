#include "reference/specular/albedo_table.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <stdexcept>

#include "models/microfacet/fresnel.h"
#include "reference/estimate.h"

namespace lobefit {

namespace {

using Rule = boost::math::quadrature::tanh_sinh<double>;

/// On the rule's own interval: between limits, Boost insists on resolving distances to the ends that doubles may not.
/// Adds to `error`.
template <class F>
double integrate_between(Rule& rule, const F& f, double from, double to, double tolerance, double& error) {
  const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
  double own_error = 0.0;
  const double mean = rule.integrate([&](double t) { return f(middle + half * t); }, tolerance, &own_error);
  error += half * own_error;
  return half * mean;
}

// The plane of relative slopes in polar coordinates: a facet of relative slope r at azimuth φ has the normal
// m ∝ (α r cos φ, α r sin φ, 1), and light comes from w = (sin θ, 0, cos θ). Its visible normals have the density
// (μ + r g) P22(r) r dr dφ / σ(w), g = α sin θ cos φ, with w·m = (μ + r g)/√(1 + α² r²).
class VisibleSlopes {
 public:
  VisibleSlopes(const Facets& facets, double cosine)
      : facets_(facets), mu_(cosine), w_{sqrt((1.0 - cosine) * (1.0 + cosine)), 0.0, cosine} {
    area_ = facets.projected_area(w_);
  }

  const Direction& w() const { return w_; }

  /// ∫ value(m, w·m) over visible normals. On each azimuth the slopes are cut where `cuts(g, slopes)` says, and
  /// azimuths at `azimuth_cuts`: there the integrand may have kinks.
  template <class Value, class Cuts>
  AlbedoValue integrate(const Value& value, const Cuts& cuts, std::vector<double> azimuth_cuts) const {
    // Tanh-sinh crowds its points at the ends of an interval, where the integrands bend.
    thread_local Rule inner(9), outer(7);
    const bool ggx = facets_.distribution == Distribution::ggx;
    const double alpha = facets_.alpha_x;
    double inner_error = 0.0;
    const auto over_slopes = [&](double azimuth) {
      const double c = std::cos(azimuth), s = std::sin(azimuth), g = alpha * w_.x * c;
      const auto at = [&](double r) {
        const double cosine_over_z = mu_ + r * g;
        if (!(cosine_over_z > 0.0)) return 0.0;
        const double z = 1.0 / std::sqrt(1.0 + alpha * alpha * r * r);
        return cosine_over_z * value(Direction{alpha * r * c * z, alpha * r * s * z, z}, min(cosine_over_z * z, 1.0));
      };
      // The variable is x = atan r (GGX) or r (Beckmann): x spans [0, end].
      const double last = ggx ? 0.5 * pi : 6.5;
      const auto integrand = [&](double x) {
        if (!ggx) return x * std::exp(-x * x) / pi * at(x);
        const double sine = std::sin(x), cosine = std::cos(x);
        if (!(cosine > 1e-12)) return 0.0;  // density ∝ cos x: all that is beyond weighs 1e-12
        return sine * cosine / pi * at(sine / cosine);
      };
      std::vector<double> knots{0.0, last};
      const auto cut = [&](double r) {
        const double x = ggx ? std::atan(r) : r;
        if (x > 0.0 && x < last) knots.push_back(x);
      };
      if (g < 0.0) cut(mu_ / -g);  // facets beyond turn away
      cuts(g, cut);
      std::sort(knots.begin(), knots.end());
      double sum = 0.0;
      for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
        double error = 0.0;
        sum += integrate_between(inner, integrand, knots[i], knots[i + 1], 1e-9, error);
        inner_error = max(inner_error, error);
      }
      return sum;
    };
    azimuth_cuts.insert(azimuth_cuts.end(), {0.0, 0.5 * pi, pi});
    std::sort(azimuth_cuts.begin(), azimuth_cuts.end());
    AlbedoValue result;
    for (std::size_t i = 0; i + 1 < azimuth_cuts.size(); ++i) {
      result.value += integrate_between(outer, over_slopes, azimuth_cuts[i], azimuth_cuts[i + 1], 1e-7, result.error);
    }
    result.error += pi * inner_error;
    // The other half of the azimuths is the mirror image.
    return {2.0 * result.value / area_, 2.0 * result.error / area_};
  }

  /// Slopes at azimuth g where w·m = critical: a quadratic's roots.
  template <class Cut>
  void cut_at_cosine(double g, double critical, const Cut& cut) const {
    const double alpha = facets_.alpha_x, a = g * g - critical * critical * alpha * alpha;
    const double c = (mu_ - critical) * (mu_ + critical);
    const double discriminant = mu_ * mu_ * g * g - a * c;
    if (!(discriminant >= 0.0)) return;
    // Of the two forms of a root, that without cancellation.
    const double q = -(mu_ * g + (g < 0.0 ? -1.0 : 1.0) * std::sqrt(discriminant));
    if (a != 0.0) cut(q / a);
    if (q != 0.0) cut(c / q);
  }
  /// Azimuths where those roots meet.
  std::vector<double> azimuths_at_cosine(double critical) const {
    const double cosine = sqrt((critical - mu_) * (critical + mu_)) / w_.x;
    return critical > mu_ && cosine < 1.0 ? std::vector{std::acos(cosine)} : std::vector<double>{};
  }

 private:
  Facets facets_;
  double mu_;
  Direction w_;
  double area_;
};

/// Where total reflection begins.
double critical_cosine_of(double eta) { return eta < 1.0 ? sqrt((1.0 - eta) * (1.0 + eta)) : 0.0; }

void check(const Facets& facets, double cosine) {
  if (facets.alpha_x != facets.alpha_y || !(facets.alpha_x >= 1e-4)) {
    throw Error(ExitCode::usage, "directional albedos are for rough isotropic facets", "alpha",
                "choose alpha from 1e-4 to 1");
  }
  if (!(cosine > 0.0 && cosine <= 1.0)) {
    throw Error(ExitCode::usage, "a cosine is out of range", "mu", "choose it above 0 and at most 1");
  }
}

}  // namespace

AlbedoValue reflected_albedo(const Facets& facets, InterfaceMasking masking, double cosine,
                             const std::function<double(double cosine_d)>& reflectance, double critical_cosine) {
  check(facets, cosine);
  const VisibleSlopes slopes(facets, cosine);
  const double lambda = facets.lambda(slopes.w()), mu = cosine, alpha = facets.alpha_x;
  const auto value = [&](const Direction& m, double cosine_d) {
    const Direction to = m * (2.0 * cosine_d) - slopes.w();
    if (!(to.z > 0.0)) return 0.0;
    return reflectance(cosine_d) * masking_ratio(masking, lambda, facets.lambda(to), true);
  };
  const auto cuts = [&](double g, const auto& cut) {
    // Facets beyond reflect downwards: μ α² r² - 2 g r - μ = 0.
    const double root = std::sqrt(g * g + mu * mu * alpha * alpha);
    cut(g > 0.0 ? (g + root) / (mu * alpha * alpha) : mu / (root - g));
    if (critical_cosine > 0.0) slopes.cut_at_cosine(g, critical_cosine, cut);
  };
  return slopes.integrate(value, cuts,
                          critical_cosine > 0.0 ? slopes.azimuths_at_cosine(critical_cosine) : std::vector<double>{});
}

AlbedoValue transmitted_albedo(const Facets& facets, InterfaceMasking masking, double cosine, double eta) {
  check(facets, cosine);
  const VisibleSlopes slopes(facets, cosine);
  const double lambda = facets.lambda(slopes.w()), mu = cosine, alpha = facets.alpha_x;
  const double critical = critical_cosine_of(eta);
  // The refracted ray's height, but for a positive factor: η times it.
  const auto height = [&](double z, double cosine_d) {
    return (cosine_d - sqrt(eta * eta - 1.0 + cosine_d * cosine_d)) * z - mu;
  };
  const auto value = [&](const Direction& m, double cosine_d) {
    if (!(cosine_d > critical && height(m.z, cosine_d) < 0.0)) return 0.0;
    const Direction to = refract(slopes.w(), m, cosine_d, eta);
    if (!(to.z < 0.0)) return 0.0;
    return (1.0 - DielectricFresnel::evaluate(cosine_d, eta)) *
           masking_ratio(masking, lambda, facets.lambda(-to), false);
  };
  const auto cuts = [&](double g, const auto& cut) {
    if (eta >= 1.0) return;  // light always gets down
    std::vector<double> roots;
    slopes.cut_at_cosine(g, critical, [&](double r) {
      cut(r);
      if (r > 0.0) roots.push_back(r);
    });
    // Near total reflection, at facets that lean towards the light, refracted rays still point up. There is one slope
    // where that ends, between the first facet that transmits and the facet that faces the light.
    if (!(g > 0.0) || roots.empty()) return;
    const auto up = [&](double r) {
      const double z = 1.0 / std::sqrt(1.0 + alpha * alpha * r * r);
      return height(z, (mu + r * g) * z) > 0.0;
    };
    double low = *std::min_element(roots.begin(), roots.end()), high = max(low, g / (mu * alpha * alpha));
    low = low * (1.0 + 1e-14);
    if (!up(low) || up(high)) return;
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      (up(middle) ? low : high) = middle;
    }
    cut(high);
  };
  return slopes.integrate(value, cuts, eta < 1.0 ? slopes.azimuths_at_cosine(critical) : std::vector<double>{});
}

AlbedoValue average_albedo(const std::function<AlbedoValue(double cosine)>& albedo, double critical_cosine) {
  Rule rule(6);
  double largest_error = 0.0, error = 0.0;
  // Over θ: there, albedos bend at grazing angles, and where total reflection begins.
  const auto between = [&](double from, double to) {
    return integrate_between(
        rule,
        [&](double theta) {
          const AlbedoValue at = albedo(max(std::cos(theta), 1e-6));
          largest_error = max(largest_error, at.error);
          return at.value * std::sin(2.0 * theta);
        },
        from, to, 1e-6, error);
  };
  const double knot = std::acos(critical_cosine);
  double mean = between(0.0, knot);
  if (critical_cosine > 0.0) mean += between(knot, 0.5 * pi);
  return {mean, error + largest_error};
}

namespace {

/// What comes back and what gets across.
struct Shares {
  AlbedoValue reflected, transmitted;
};

double critical_cosine_of(const FacetReflectance& reflectance, double eta) {
  return reflectance.transmits() ? critical_cosine_of(eta) : 0.0;
}

/// Of light on one side of an interface.
class SideAlbedo {
 public:
  SideAlbedo(const AlbedoTableOptions& options, double alpha, bool above)
      : interface_({options.distribution, alpha, alpha}, options.reflectance, options.bounces, options.masking),
        above_(above),
        eta_(above ? options.reflectance.ior() : 1.0 / options.reflectance.ior()) {}

  Shares single(double mu) const { return {single_reflected(mu), single_transmitted(mu)}; }
  Shares single_average() const {
    const auto& reflectance = interface_.reflectance();
    Shares result{.reflected = average_albedo([&](double mu) { return single_reflected(mu); },
                                              critical_cosine_of(reflectance, eta_)),
                  .transmitted = {}};
    if (!reflectance.transmits()) return result;
    // Reciprocity: n² times what gets across is the same from both sides, and without total reflection it is smooth.
    const double denser = max(eta_, 1.0 / eta_);
    const AlbedoValue entering = average_albedo(
        [&](double mu) { return transmitted_albedo(interface_.facets(), interface_.masking(), mu, denser); });
    const double factor = eta_ < 1.0 ? eta_ * eta_ : 1.0;
    result.transmitted = {entering.value * factor, entering.error * factor};
    return result;
  }

  /// What bounces after the first add; mu = 0: averaged, 2 ∫ … μ dμ.
  Shares further(double mu, std::uint32_t samples_per_replicate, std::uint64_t seed, std::uint64_t entry) const {
    std::array<double, replicate_count> reflected{}, transmitted{};
    for (std::size_t r = 0; r < replicate_count; ++r) {
      const SamplePoints points(Sampler::sobol, {seed, entry, static_cast<std::uint32_t>(r)});
      for (std::uint32_t k = 0; k < samples_per_replicate; ++k) {
        PathNumbers numbers(points, k);
        const double cosine = mu > 0.0 ? mu : std::sqrt(numbers.next());
        InterfaceSample result{};
        const bool escaped = interface_.walk(direction(std::acos(above_ ? cosine : -cosine), 0.0), numbers, result,
                                             RoughInterface::Second::forced, [](const RoughInterface::Vertex&) {});
        if (escaped) (result.reflected ? reflected : transmitted)[r] += result.weight.x;
      }
      reflected[r] /= samples_per_replicate, transmitted[r] /= samples_per_replicate;
    }
    const auto summary = [](const std::array<double, replicate_count>& replicates) {
      const MeanAndError mean = mean_and_error(std::span<const double>(replicates));
      return AlbedoValue{mean.mean, mean.standard_error};
    };
    return {summary(reflected), summary(transmitted)};
  }

 private:
  AlbedoValue single_reflected(double mu) const {
    return reflected_albedo(
        interface_.facets(), interface_.masking(), mu,
        [&](double cosine) { return interface_.reflectance()(cosine, eta_).x; },
        critical_cosine_of(interface_.reflectance(), eta_));
  }
  AlbedoValue single_transmitted(double mu) const {
    return interface_.reflectance().transmits()
               ? transmitted_albedo(interface_.facets(), interface_.masking(), mu, eta_)
               : AlbedoValue{};
  }

  RoughInterface interface_;
  bool above_;
  double eta_;
};

AlbedoValue operator+(const AlbedoValue& a, const AlbedoValue& b) {
  return {a.value + b.value, std::hypot(a.error, b.error)};
}

}  // namespace

AlbedoTable make_albedo_table(const AlbedoTableOptions& options, Monitor& monitor) {
  if (options.mu.empty() || options.alpha.empty()) {
    throw Error(ExitCode::usage, "a table needs cosines and alphas", "mu, alpha", "give at least one of each");
  }
  // RoughInterface refuses bounces and maskings that do not go together.
  for (const double alpha : options.alpha) {
    const RoughInterface interface({options.distribution, alpha, alpha}, options.reflectance, options.bounces,
                                   options.masking);
    for (const double mu : options.mu) check(interface.facets(), mu);
    if (alpha > 1.0) throw Error(ExitCode::usage, "an alpha is out of range", "alpha", "choose it from 1e-4 to 1");
  }
  if (!options.reflectance.grey()) {
    throw Error(ExitCode::usage, "the table has one channel", "f0, f90, eta, k",
                "give all channels one value, and make a table per channel");
  }
  const auto per_replicate = static_cast<std::uint32_t>((options.samples + replicate_count - 1) / replicate_count);
  const bool single = options.bounces == 1, transmits = options.reflectance.transmits();
  const bool split = single && options.reflectance.kind() == FacetReflectance::Kind::schlick;

  AlbedoTable table{.options = options, .columns = {}};
  const std::size_t stride = options.mu.size() + 1;  // the average is one more entry of a row
  const auto add_column = [&](const std::string& name, const std::string& doc) {
    const std::size_t rows = options.alpha.size(), cells = rows * options.mu.size();
    table.columns.push_back({name, doc, std::vector<double>(cells), std::vector<double>(cells),
                             std::vector<double>(rows), std::vector<double>(rows)});
  };
  if (split) {
    add_column("albedo", "E: directional albedo for F = 1");
    add_column("f0_weight", "A: E_F = f0 A + f90 B with Schlick's Fresnel factor");
    add_column("f90_weight", "B: see f0_weight; A + B = E");
  } else if (!transmits) {
    add_column("reflected", "directional albedo");
  } else {
    for (const char* side : {"above", "below"}) {
      add_column(std::string("reflected_") + side, std::string("share of light from ") + side + " that comes back");
      add_column(std::string("transmitted_") + side, std::string("share of light from ") + side + " that gets across");
    }
  }
  const auto put = [&](std::size_t column, std::size_t row, std::size_t cell, const AlbedoValue& value) {
    AlbedoColumn& target = table.columns[column];
    const bool average = cell + 1 == stride;
    (average ? target.average[row] : target.value[row * (stride - 1) + cell]) = value.value;
    (average ? target.average_error[row] : target.error[row * (stride - 1) + cell]) = value.error;
  };

  const std::size_t sides = transmits ? 2 : 1, jobs = sides * options.alpha.size() * stride;
  monitor.begin("albedo table", jobs);
  tbb::parallel_for(std::size_t{0}, jobs, [&](std::size_t job) {
    monitor.check();
    const std::size_t cell = job % stride, row = job / stride % options.alpha.size();
    const std::size_t side = job / stride / options.alpha.size();
    const double alpha = options.alpha[row];
    const bool average = cell + 1 == stride;
    const double mu = average ? 0.0 : options.mu[cell];
    if (split) {
      const Facets facets{options.distribution, alpha, alpha};
      const auto weighted = [&](double f0) {
        const auto at = [&](double cosine) {
          return reflected_albedo(facets, options.masking, cosine,
                                  [f0](double c) { return SchlickFresnel::evaluate(c, f0, 1.0); });
        };
        return average ? average_albedo(at) : at(mu);
      };
      const AlbedoValue all = weighted(1.0), grazing = weighted(0.0);
      put(0, row, cell, all);
      put(1, row, cell, {all.value - grazing.value, all.error + grazing.error});
      put(2, row, cell, grazing);
    } else {
      const SideAlbedo albedo(options, alpha, side == 0);
      Shares shares = average ? albedo.single_average() : albedo.single(mu);
      if (!single) {
        const Shares further = albedo.further(mu, per_replicate, options.seed, job);
        shares = {shares.reflected + further.reflected, shares.transmitted + further.transmitted};
      }
      put(2 * side, row, cell, shares.reflected);
      if (transmits) put(2 * side + 1, row, cell, shares.transmitted);
    }
    monitor.advance(1);
  });
  monitor.end();
  return table;
}

Json AlbedoTable::json(const Json& parameters, const std::string& command) const {
  const bool single = options.bounces == 1;
  const auto rows = [&](const std::vector<double>& values) {
    Json result = Json::array();
    for (std::size_t row = 0; row < options.alpha.size(); ++row) {
      const auto begin = values.begin() + static_cast<std::ptrdiff_t>(row * options.mu.size());
      result.push_back(std::vector<double>(begin, begin + static_cast<std::ptrdiff_t>(options.mu.size())));
    }
    return result;
  };
  Json json{{"quantity", "directional albedo"},
            {"units", {{"mu", "cosine of the polar angle"}, {"alpha", "1"}, {"values", "share of the flux"}}},
            {"layout", "values[alpha][mu]; average[alpha] = 2 ∫ E(mu) mu dmu"},
            {"mu", options.mu},
            {"alpha", options.alpha},
            {"columns", Json::object()}};
  for (const AlbedoColumn& column : columns) {
    json["columns"][column.name] = {{"doc", column.doc},
                                    {"values", rows(column.value)},
                                    {"error", rows(column.error)},
                                    {"average", column.average},
                                    {"average_error", column.average_error}};
  }
  json["parameters"] = parameters;
  json["provenance"] = {{"version", LOBEFIT_VERSION},
                        {"command", command},
                        {"method", single ? "quadrature" : "quadrature for the first bounce, walks for the others"},
                        {"error", single ? "the quadrature's estimate" : "standard error, of 32 replicates"}};
  if (!single) {
    json["provenance"]["seed"] = options.seed;
    const std::uint64_t per_replicate = (options.samples + replicate_count - 1) / replicate_count;
    json["provenance"]["samples"] = per_replicate * replicate_count;
  }
  return json;
}

const AlbedoColumn& AlbedoTable::column(std::string_view name) const {
  for (const AlbedoColumn& candidate : columns) {
    if (candidate.name == name) return candidate;
  }
  throw std::out_of_range("no albedo column " + std::string(name));
}

}  // namespace lobefit
