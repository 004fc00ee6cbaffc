#include "reference/diffuse/microfacet_diffuse.h"

#include <algorithm>
#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <string>

#include "models/microfacet/fresnel.h"
#include "reference/diffuse/facet_quadrature.h"
#include "reference/diffuse/single_kernel.h"
#include "reference/diffuse/smith_orders.h"
#include "reference/diffuse/walk_lanes.h"
#include "reference/visible_normals.h"

namespace lobefit {

namespace {

constexpr std::uint32_t block = 1024;                 // paths that walk together
constexpr std::uint32_t most_disk_points = 1u << 16;  // that are worth their memory

/// Density cosine/π about m: the facet plus a point of the unit sphere.
Direction sample_cosine(const Direction& m, const std::array<double, 2>& u) {
  const double phi = 2.0 * pi * u[1], radius = 2.0 * std::sqrt(u[0] * (1.0 - u[0]));
  return normalize(m + Direction{radius * std::cos(phi), radius * std::sin(phi), 1.0 - 2.0 * u[0]});
}

/// Λ of a ray of direction w: of w itself where it rises, -1 - Λ(-w) where it falls.
double ray_lambda(Distribution distribution, Alpha alpha, const Direction& w) {
  // Beckmann's ends in -0 or less where its terms underflow; a ray so steep meets nothing.
  if (w.z > 0.0) return std::max(0.0, smith_lambda(distribution, alpha, w));
  return -1.0 - smith_lambda(distribution, alpha, {w.x, w.y, std::max(-w.z, 1e-300)});
}

}  // namespace

DiffuseFacet::DiffuseFacet(const MicrofacetDiffuse::Parameters<double>& p)
    : kind_(static_cast<FacetKind>(p.facet)), eta_(p.eta), callisto_(p.callisto) {
  // Mean reflectance from outside, 2 ∫ F μ dμ; what the body sees of it from inside follows (formulas.md §7).
  external_mean_ =
      boost::math::quadrature::gauss<double, 60>::integrate([&](double mu) { return 2.0 * mu * mirror(mu); }, 0.0, 1.0);
  internal_mean_ = 1.0 - (1.0 - external_mean_) / (eta_ * eta_);
}

double DiffuseFacet::mirror(double cosine) const {
  return kind_ == FacetKind::interfaced && eta_ > 1.0 ? DielectricFresnel::evaluate(cosine, eta_) : 0.0;
}

double DiffuseFacet::body_albedo(double rho) const {
  return kind_ == FacetKind::interfaced ? rho * (1.0 - internal_mean_) / (1.0 - rho * internal_mean_) : rho;
}

double DiffuseFacet::body(double cos_i, double cos_o, double cos_h, double cos_d) const {
  switch (kind_) {
    case FacetKind::lambert: break;
    case FacetKind::interfaced: return (1.0 - mirror(cos_i)) * (1.0 - mirror(cos_o)) / (1.0 - external_mean_);
    case FacetKind::callisto: return callisto_modulation(callisto_, cos_d, cos_h);
  }
  return 1.0;
}

double DiffuseFacet::body(const Direction& wi, const Direction& wo, const Direction& m) const {
  const Direction h = normalize(wi + wo);
  return body(dot(wi, m), dot(wo, m), dot(h, m), dot(wi, h));
}

MicrofacetDiffuseSurface::MicrofacetDiffuseSurface(std::span<const double> flat)
    : alpha_(1.0), facet_(unflatten<MicrofacetDiffuse, double>(flat)) {
  const auto p = unflatten<MicrofacetDiffuse, double>(flat);
  distribution_ = static_cast<Distribution>(p.distribution);
  masking_ = static_cast<Masking>(p.masking);
  alpha_ = {p.alpha_x > 0.0 ? p.alpha_x : p.alpha, p.alpha_y > 0.0 ? p.alpha_y : p.alpha};
  cos_orientation_ = std::cos(radians(p.orientation));
  sin_orientation_ = std::sin(radians(p.orientation));
  albedo_ = p.albedo;
  grey_ = albedo_.x == albedo_.y && albedo_.x == albedo_.z;
  const auto choice = static_cast<std::size_t>(p.bounces);
  bounces_ = choice + 1 < MicrofacetDiffuse::bounce_choices.size() ? static_cast<int>(choice) + 1 : unlimited;
  const auto refuse = [](const std::string& what, const std::string& mend) {
    return Error(ExitCode::usage, what, std::string(MicrofacetDiffuse::name), mend);
  };
  if (bounces_ > 1 && masking_ != Masking::correlated) {
    throw refuse("more than one bounce implies correlated masking: the walk finds its own heights",
                 "set masking=correlated, or bounces=1");
  }
  if (masking_ == Masking::area_mean && facet_.kind() != FacetKind::lambert) {
    throw refuse("area_mean is independent of the view, its facets can only be Lambertian",
                 "set facet=lambert or another masking");
  }
}

MicrofacetDiffuseSurface::~MicrofacetDiffuseSurface() = default;

int MicrofacetDiffuseSurface::orders() const {
  return facet_.kind() == FacetKind::interfaced ? 0 : std::min(bounces_, kept_orders);
}

Direction MicrofacetDiffuseSurface::to_surface(const Direction& w) const {
  return {cos_orientation_ * w.x + sin_orientation_ * w.y, cos_orientation_ * w.y - sin_orientation_ * w.x, w.z};
}

Direction MicrofacetDiffuseSurface::seen_from(const Direction& wo) const {
  return masking_ == Masking::area_mean ? Direction{0.0, 0.0, 1.0} : wo;
}

double MicrofacetDiffuseSurface::weight(const Direction& wi, const Direction& wo) const {
  const double lambda_i = smith_lambda(distribution_, alpha_, wi);
  const double lambda_o = smith_lambda(distribution_, alpha_, wo);
  double g2_over_g1 = 1.0;  // G2/G1(wo): visible normals carry G1(wo) already
  switch (masking_) {
    case Masking::correlated: g2_over_g1 = (1.0 + lambda_o) / (1.0 + lambda_i + lambda_o); break;
    case Masking::separable: g2_over_g1 = 1.0 / (1.0 + lambda_i); break;
    case Masking::none: g2_over_g1 = 1.0 + lambda_o; break;
    case Masking::view_only: break;
    case Masking::area_mean: break;
  }
  return g2_over_g1;
}

double MicrofacetDiffuseSurface::exact_first_order(const Direction& wi, const Direction& wo) const {
  const Direction seen = seen_from(wo);
  const bool simple = facet_.kind() == FacetKind::lambert && alpha_.x == alpha_.y;
  const double shared = simple ? shared_visibility(distribution_, alpha_.x, wi, seen)
                               : shared_visibility(distribution_, alpha_, wi, seen,
                                                   [&](const Direction& m) { return facet_.body(wi, seen, m); });
  // The mean over visible normals is E[(wi·m)⁺] = K(wi, w) G1(w)/(w·n).
  return weight(wi, wo) * shared / (pi * wi.z * seen.z * (1.0 + smith_lambda(distribution_, alpha_, seen)));
}

const SmithOrders& MicrofacetDiffuseSurface::smith_orders() const {
  std::call_once(solved_, [&] {
    smith_orders_ = std::make_unique<SmithOrders>(distribution_, alpha_.x, std::min(bounces_, most_orders));
  });
  return *smith_orders_;
}

bool MicrofacetDiffuseSurface::has_exact() const {
  return bounces_ == 1 || (facet_.kind() == FacetKind::lambert && alpha_.x == alpha_.y);
}

void MicrofacetDiffuseSurface::exact_row(const Direction& wo, std::span<const Direction> wi, const Line& line) const {
  if (!has_exact()) return Integrator::exact_row(wo, wi, line);
  const std::size_t n = wi.size();
  const Direction view = to_surface(wo);
  std::vector<Direction> lights(n);
  for (std::size_t j = 0; j < n; ++j) lights[j] = to_surface(wi[j]);
  OrderSums sums = bounces_ == 1 ? OrderSums(n) : smith_orders().evaluate(lights, view);
  for (std::size_t j = 0; j < n; ++j) sums[j] = exact_first_order(lights[j], view);
  finish(sums, n, line);
}

void MicrofacetDiffuseSurface::finish(const OrderSums& sums, std::size_t lights, const Line& line) const {
  const Rgb albedo{facet_.body_albedo(albedo_.x), facet_.body_albedo(albedo_.y), facet_.body_albedo(albedo_.z)};
  std::fill(line.values.begin(), line.values.end(), Rgb{});
  std::fill(line.orders.begin(), line.orders.end(), 0.0);
  // From the last order back, as f = ρ (f_1 + ρ (f_2 + …)).
  const std::size_t kept = line.orders.size() / lights;
  for (std::size_t k = sums.size() / lights; k-- > 0;) {
    for (std::size_t j = 0; j < lights; ++j) {
      const double f = sums[k * lights + j];
      line.values[j] = albedo * (line.values[j] + Rgb{f, f, f});
      if (kept > 0) line.orders[std::min(k, kept - 1) * lights + j] += f;
    }
  }
}

void MicrofacetDiffuseSurface::sample_row(const Direction& wo, std::span<const Direction> wi,
                                          const SamplePoints& points, std::uint32_t samples, bool fast,
                                          const Line& line) const {
  const std::size_t n = wi.size();
  const Direction view = to_surface(wo), seen = seen_from(view);
  std::vector<Direction> lights(n);
  for (std::size_t j = 0; j < n; ++j) lights[j] = to_surface(wi[j]);
  OrderSums sums(n, 0.0);
  const auto order_sums = [&](std::size_t order) {
    if (sums.size() < order * n) sums.resize(order * n, 0.0);
    return std::span(sums).subspan((order - 1) * n, n);
  };
  const bool lanes = fast && facet_.kind() == FacetKind::lambert;
  if (!lanes || (bounces_ > 1 && distribution_ != Distribution::ggx)) {
    sample_paths(view, lights, points, samples, sums);
  } else if (n == 1 && bounces_ == 1 && distribution_ == Distribution::ggx && samples <= most_disk_points) {
    sums[0] =
        samples * weight(lights[0], view) * mean_visible_cosine(DiskPoints(points, samples), alpha_, seen, lights[0]);
  } else {
    LightLanes light_lanes(distribution_, alpha_, lights);
    WalkLanes walk(alpha_, points);
    std::array<float, block> u, v, mx, my, mz;
    const double lambda_o = smith_lambda(distribution_, alpha_, view);
    for (std::uint32_t first = 0; first < samples; first += block) {
      const std::uint32_t count = std::min(block, samples - first);
      const auto part = [&](auto& array) { return std::span(array).first(count); };
      points.fill(first, part(u), part(v));
      sample_visible_normals(distribution_, alpha_, seen, part(u), part(v), {part(mx), part(my), part(mz)});
      light_lanes.add(part(mx), part(my), part(mz), {}, order_sums(1));
      if (bounces_ == 1) continue;
      walk.start(first, part(mx), part(my), part(mz), lambda_o);
      for (int order = 2; order <= bounces_ && walk.advance() > 0; ++order) {
        light_lanes.add(walk.mx(), walk.my(), walk.mz(), walk.tau(),
                        order_sums(static_cast<std::size_t>(std::min(order, most_orders))));
      }
    }
    for (std::size_t j = 0; j < n; ++j) sums[j] *= weight(lights[j], view);
  }
  for (std::size_t k = 0; k < sums.size(); ++k) sums[k] /= pi * lights[k % n].z * samples;
  finish(sums, n, line);
}

// Order n of Lambertian facets is what n bounces give. Of interfaced ones it counts the scatterings by bodies, mirror
// reflections between them come along; light that no body scattered belongs to microfacet_specular.
void MicrofacetDiffuseSurface::sample_paths(const Direction& wo, std::span<const Direction> wi,
                                            const SamplePoints& points, std::uint32_t samples, OrderSums& sums) const {
  const std::size_t n = wi.size();
  const Direction seen = seen_from(wo);
  const bool interfaced = facet_.kind() == FacetKind::interfaced;
  std::vector<double> lambda_i(n);
  // Only the first facet's light has its masking in closed form; what comes by way of a mirror may be of order 1 too.
  std::vector<double> first_weight(n);
  for (std::size_t j = 0; j < n; ++j) {
    lambda_i[j] = smith_lambda(distribution_, alpha_, wi[j]);
    first_weight[j] = weight(wi[j], wo);
  }
  const auto add = [&](int order, std::size_t j, double value) {
    const auto slot = static_cast<std::size_t>(std::min(order, most_orders) - 1) * n + j;
    if (sums.size() <= slot) sums.resize((slot / n + 1) * n, 0.0);
    sums[slot] += value;
  };
  for (std::uint32_t k = 0; k < samples; ++k) {
    PathNumbers numbers(points, k);
    Direction m = sample_visible_normal(distribution_, alpha_, seen, numbers.next_pair());
    for (std::size_t j = 0; j < n; ++j) {
      const double cosine = dot(m, wi[j]);
      if (cosine > 0.0) {
        sums[j] += first_weight[j] * cosine * (facet_.kind() == FacetKind::lambert ? 1.0 : facet_.body(wi[j], seen, m));
      }
    }
    if (bounces_ == 1) continue;
    // From here on the path's depth is drawn, and light on the way in is shadowed by it.
    const std::array<double, 2> first = numbers.next_pair();
    double tau = -std::log(first[0]) / (1.0 + smith_lambda(distribution_, alpha_, wo));
    double flight = first[1], throughput = 1.0;
    Direction from = wo;  // reverse of the ray that met m
    int bodies = 0;
    for (int bounce = 2; bounce <= bounces_; ++bounce) {
      // Leave the facet.
      const double reflected = facet_.mirror(dot(m, from));
      Direction w;
      if (interfaced && numbers.next() < reflected) {
        w = normalize(m * (2.0 * dot(m, from)) - from);
      } else {
        w = sample_cosine(m, numbers.next_pair());
        // Density cosine/π; the coin has taken the factor 1 - mirror(from).
        throughput *= interfaced ? facet_.body(w, from, m) / (1.0 - reflected) : facet_.body(w, from, m);
        ++bodies;
      }
      // Fly.
      tau += std::log(flight) / ray_lambda(distribution_, alpha_, w);
      if (!(tau >= 0.0)) break;
      // Meet the next facet.
      from = -w;
      m = sample_visible_normal(distribution_, alpha_, from, numbers.next_pair());
      const double area = std::abs(w.z * ray_lambda(distribution_, alpha_, w));  // σ(from)
      for (std::size_t j = 0; j < n; ++j) {
        const double lit = throughput * std::exp(-lambda_i[j] * tau);
        const double cosine = dot(m, wi[j]);
        if (cosine > 0.0) {
          const double body = facet_.kind() == FacetKind::lambert ? 1.0 : facet_.body(wi[j], from, m);
          add(bodies + 1, j, lit * cosine * body);
        }
        if (interfaced && bodies > 0) {
          // The mirror's share of the phase function: F D(h)/(4 σ), h the only facet that connects.
          const Direction h = normalize(wi[j] + from);
          if (h.z > 0.0 && dot(h, from) > 0.0) {
            add(bodies, j,
                lit * pi * facet_.mirror(dot(h, from)) * facet_density(distribution_, alpha_, h) / (4.0 * area));
          }
        }
      }
      flight = numbers.next();
    }
  }
}

Reference microfacet_diffuse_reference() {
  using R = MicrofacetDiffuse;
  return {.name = R::name,
          .doc = R::doc,
          .source = R::source,
          .parameters = describe_parameters<R>(),
          .make = [](const ParameterValues& values) -> std::unique_ptr<const Integrator> {
            return std::make_unique<MicrofacetDiffuseSurface>(values.flat());
          }};
}

}  // namespace lobefit
