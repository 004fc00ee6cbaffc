#include "reference/microfacet_diffuse.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <vector>

#include "models/instruction_sets.h"
#include "reference/visible_normals.h"

namespace lobefit {

namespace {

/// ∫ (A + B cos φ)(C + E cos(φ - Δ)) dφ over [from, to].
struct AzimuthIntegral {
  double a, b, c, e, delta;

  double antiderivative(double phi) const {
    return (a * c + 0.5 * b * e * std::cos(delta)) * phi + a * e * std::sin(phi - delta) + b * c * std::sin(phi) +
           0.25 * b * e * std::sin(2.0 * phi - delta);
  }
  double over(double from, double to) const {
    if (to <= from) return 0.0;
    if (to - from > 1.0) return antiderivative(to) - antiderivative(from);
    // On a short arc the difference of antiderivatives loses digits, most of them between opposite grazing directions;
    // nine Gauss-Legendre points are exact to rounding there, and all terms are positive.
    double sum = 0.0;
    const double centre = 0.5 * (from + to), half = 0.5 * (to - from);
    const auto at = [&](double phi) { return (a + b * std::cos(phi)) * (c + e * std::cos(phi - delta)); };
    using Rule = boost::math::quadrature::gauss<double, 9>;
    for (std::size_t k = 0; k < Rule::abscissa().size(); ++k) {
      const double offset = half * Rule::abscissa()[k];
      sum += Rule::weights()[k] * (offset == 0.0 ? at(centre) : at(centre - offset) + at(centre + offset));
    }
    return half * sum;
  }
};

/// Half width of the arc of facet azimuths that turn away from a direction, facets being as (rise, run) steep.
double hidden_half_width(double run, double rise, double cosine, double sine) {
  const double edge = rise * sine, level = run * cosine;
  return edge > level ? std::acos(level / edge) : 0.0;
}

/// The azimuthal part of K for facets of slope rise/run, over 2π: mean of run² (m·a)⁺ (m·b)⁺ / cos²θ_m.
double azimuth_mean(double run, double rise, const Direction& a, const Direction& b, double sine_a, double sine_b,
                    double delta) {
  const AzimuthIntegral integral{run * a.z, rise * sine_a, run * b.z, rise * sine_b, delta};
  // Facets turn away from a around azimuth π, from b around Δ + π. What is left is one arc, or two.
  const double hidden_a = hidden_half_width(run, rise, a.z, sine_a);
  const double hidden_b = hidden_half_width(run, rise, b.z, sine_b);
  double sum = 0.0;
  if (hidden_a + hidden_b < delta) {
    sum = integral.over(hidden_a - pi, delta - pi - hidden_b) + integral.over(delta - pi + hidden_b, pi - hidden_a);
  } else {
    const double from = std::max(hidden_a, delta + hidden_b);
    const double to = 2.0 * pi + std::min(-hidden_a, delta - hidden_b);
    sum = integral.over(from - pi, to - pi);
  }
  return sum / (2.0 * pi);
}

constexpr std::uint32_t block = 256;  // facets summed in float before the sum moves to double
constexpr std::uint32_t pack = 8;     // facets that pass while a sum is in its register; divides block

/// sums[j] += Σ over facets of (m · wi_j)⁺. Lanes are directions; the order of facets is the order of additions.
/// `facets` is a multiple of `pack`.
LOBEFIT_CLONES [[gnu::noinline]] void add_visible_cosines(const float* __restrict mx, const float* __restrict my,
                                                          const float* __restrict mz, std::uint32_t facets,
                                                          const float* __restrict x, const float* __restrict y,
                                                          const float* __restrict z, std::size_t n,
                                                          float* __restrict sums) {
  for (std::size_t first = 0; first < facets; first += pack) {
    for (std::size_t j = 0; j < n; ++j) {
      float sum = sums[j];
#pragma GCC unroll 8
      for (std::uint32_t k = 0; k < pack; ++k) {
        const float cosine = mx[first + k] * x[j] + my[first + k] * y[j] + mz[first + k] * z[j];
        sum += cosine > 0.0f ? cosine : 0.0f;
      }
      sums[j] = sum;
    }
  }
}

}  // namespace

double shared_visibility(Distribution distribution, double alpha, const Direction& a, const Direction& b) {
  const double sine_a = std::hypot(a.x, a.y), sine_b = std::hypot(b.x, b.y);
  const double delta = std::abs(std::atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y));

  // With t = α cot x, all of it times sin x so that nothing overflows at x = 0, the far slopes, where floating point
  // resolves x best:
  // K = ∫ 2π α²P22 cot x csc²x cosθ_m azimuth_mean dx.
  const auto integrand = [&](double x, double) {
    const double s = std::sin(x), c = std::cos(x);
    double measure = 2.0 * c;
    if (distribution == Distribution::beckmann) {
      const double tau = c / s;
      if (!(tau < 26.0)) return 0.0;
      measure *= std::exp(-tau * tau) / (s * s * s * s);
    }
    return measure / std::sqrt(s * s + alpha * alpha * c * c) * azimuth_mean(s, alpha * c, a, b, sine_a, sine_b, delta);
  };

  // The visible arcs change their shape where a facet can turn away from a, from b, or from both at once; the
  // integrand has a kink there.
  std::vector<double> knots{0.0, pi / 2.0};
  const auto add_knot = [&](double rise, double run) {
    const double x = std::atan2(alpha * run, rise);
    if (x > 0.0 && x < pi / 2.0) knots.push_back(x);
  };
  add_knot(a.z, sine_a);
  add_knot(b.z, sine_b);
  const Direction edge = cross(a, b);
  add_knot(std::hypot(edge.x, edge.y), std::abs(edge.z));
  std::sort(knots.begin(), knots.end());

  thread_local boost::math::quadrature::tanh_sinh<double> integrator(15);
  double sum = 0.0;
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    if (knots[i + 1] - knots[i] > 1e-15) sum += integrator.integrate(integrand, knots[i], knots[i + 1], 1e-11);
  }
  return sum;
}

MicrofacetDiffuseSurface::MicrofacetDiffuseSurface(std::span<const double> flat) {
  const auto p = unflatten<MicrofacetDiffuse, double>(flat);
  distribution_ = static_cast<Distribution>(p.distribution);
  masking_ = static_cast<Masking>(p.masking);
  alpha_ = p.alpha;
}

double MicrofacetDiffuseSurface::exact(const Direction& wi, const Direction& wo) const {
  const Direction seen = seen_from(wo);
  // The mean over visible normals is E[(wi·m)⁺] = K(wi, w) G1(w)/(w·n).
  const double visible_mean =
      shared_visibility(distribution_, alpha_, wi, seen) / (seen.z * (1.0 + smith_lambda(distribution_, alpha_, seen)));
  return weight(wi, wo) * visible_mean;
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
  return g2_over_g1 / (pi * wi.z);
}

void MicrofacetDiffuseSurface::sample_row(const Direction& wo, std::span<const Direction> wi,
                                          const SamplePoints& points, std::uint32_t samples,
                                          std::span<double> values) const {
  std::fill(values.begin(), values.end(), 0.0);
  const Direction seen = seen_from(wo);
  for (std::uint32_t k = 0; k < samples; ++k) {
    const Direction m = sample_visible_normal(distribution_, alpha_, seen, points(k));
    for (std::size_t j = 0; j < wi.size(); ++j) values[j] += max(dot(m, wi[j]), 0.0);
  }
  for (std::size_t j = 0; j < wi.size(); ++j) values[j] *= weight(wi[j], wo) / samples;
}

void MicrofacetDiffuseSurface::sample_row_fast(const Direction& wo, std::span<const Direction> wi,
                                               const SamplePoints& points, std::uint32_t samples,
                                               std::span<double> values) const {
  std::fill(values.begin(), values.end(), 0.0);
  const Direction seen = seen_from(wo);
  const std::size_t padded = (wi.size() + 15) / 16 * 16;
  std::vector<float> x(padded), y(padded), z(padded), sums(padded);
  for (std::size_t j = 0; j < wi.size(); ++j) {
    x[j] = static_cast<float>(wi[j].x), y[j] = static_cast<float>(wi[j].y), z[j] = static_cast<float>(wi[j].z);
  }
  std::array<double, block> u, v;
  std::array<float, block> mx, my, mz;
  for (std::uint32_t first = 0; first < samples; first += block) {
    const std::uint32_t count = std::min(block, samples - first);
    points.fill(first, std::span(u).first(count), std::span(v).first(count));
    sample_visible_normals(distribution_, alpha_, seen, std::span(u).first(count), std::span(v).first(count),
                           {mx, my, mz});
    // A facet of zeros adds nothing.
    const std::uint32_t whole = (count + pack - 1) / pack * pack;
    for (std::array<float, block>* component : {&mx, &my, &mz}) {
      std::fill(component->begin() + count, component->begin() + whole, 0.0f);
    }
    std::fill(sums.begin(), sums.end(), 0.0f);
    add_visible_cosines(mx.data(), my.data(), mz.data(), whole, x.data(), y.data(), z.data(), padded, sums.data());
    for (std::size_t j = 0; j < wi.size(); ++j) values[j] += sums[j];
  }
  for (std::size_t j = 0; j < wi.size(); ++j) values[j] *= weight(wi[j], wo) / samples;
}

}  // namespace lobefit
