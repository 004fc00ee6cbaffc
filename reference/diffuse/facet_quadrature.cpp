#include "reference/diffuse/facet_quadrature.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <vector>

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

/// ∫ integrand(x) dx over the slopes t = α cot x of all facets, split where the visible arcs change their shape: where
/// a facet can turn away from a, from b, or from both at once. Directions and slopes are stretched to α = 1.
template <class F>
double integrate_slopes(const Direction& a, const Direction& b, double tolerance, F&& integrand) {
  std::vector<double> knots{0.0, pi / 2.0};
  const auto add_knot = [&](double rise, double run) {
    const double x = std::atan2(run, rise);
    if (x > 0.0 && x < pi / 2.0) knots.push_back(x);
  };
  add_knot(a.z, std::hypot(a.x, a.y));
  add_knot(b.z, std::hypot(b.x, b.y));
  const Direction edge = cross(a, b);
  add_knot(std::hypot(edge.x, edge.y), std::abs(edge.z));
  std::sort(knots.begin(), knots.end());

  // Boost 1.74's integrator refines its tables on first use without a lock.
  thread_local boost::math::quadrature::tanh_sinh<double> integrator(15);
  double sum = 0.0;
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    if (knots[i + 1] - knots[i] > 1e-15) sum += integrator.integrate(integrand, knots[i], knots[i + 1], tolerance);
  }
  return sum;
}

/// The direction whose visible facets on the surface of α = 1 are the stretched ones of w; not normalised.
Direction stretch(Alpha alpha, const Direction& w) { return {alpha.x * w.x, alpha.y * w.y, w.z}; }

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

  return integrate_slopes(stretch(alpha, a), stretch(alpha, b), 1e-11, integrand);
}

double shared_visibility(Distribution distribution, Alpha alpha, const Direction& a, const Direction& b,
                         const std::function<double(const Direction& m)>& weight) {
  const Direction stretched_a = stretch(alpha, a), stretched_b = stretch(alpha, b);
  const double sine_a = std::hypot(stretched_a.x, stretched_a.y), sine_b = std::hypot(stretched_b.x, stretched_b.y);
  const double start = std::atan2(stretched_a.y, stretched_a.x);
  const double turn = std::atan2(stretched_a.x * stretched_b.y - stretched_a.y * stretched_b.x,
                                 stretched_a.x * stretched_b.x + stretched_a.y * stretched_b.y);
  const auto integrand = [&](double x, double) {
    const double run = std::sin(x), rise = std::cos(x);
    double measure = 2.0 * rise;
    if (distribution == Distribution::beckmann) {
      const double tau = rise / run;
      if (!(tau < 26.0)) return 0.0;
      measure *= std::exp(-tau * tau) / (run * run * run * run);
    }
    const auto at = [&](double phi) {
      const double c = std::cos(phi), s = std::sin(phi);
      const double visible_a = run * a.z + rise * (stretched_a.x * c + stretched_a.y * s);
      const double visible_b = run * b.z + rise * (stretched_b.x * c + stretched_b.y * s);
      if (!(visible_a > 0.0 && visible_b > 0.0)) return 0.0;
      const double steep_x = alpha.x * rise * c, steep_y = alpha.y * rise * s;
      const double length = std::sqrt(run * run + steep_x * steep_x + steep_y * steep_y);
      return visible_a * visible_b / length * weight({steep_x / length, steep_y / length, run / length});
    };
    // Arcs of azimuths that turn away from a and from b; what is left of the circle is one arc, or two.
    const double hidden_a = hidden_half_width(run, rise, a.z, sine_a);
    const double hidden_b = hidden_half_width(run, rise, b.z, sine_b);
    std::vector<double> ends{start - pi + hidden_a, start + pi - hidden_a};
    for (const double end : {start + turn + pi - hidden_b, start + turn - pi + hidden_b}) {
      for (const double turned : {end - 2.0 * pi, end, end + 2.0 * pi}) {
        if (turned > ends.front() && turned < ends.back()) ends.push_back(turned);
      }
    }
    std::sort(ends.begin(), ends.end());
    double sum = 0.0;
    using Rule = boost::math::quadrature::gauss_kronrod<double, 31>;
    for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
      if (ends[i + 1] - ends[i] > 1e-14) sum += Rule::integrate(at, ends[i], ends[i + 1], 8, 1e-11);
    }
    return measure * sum / (2.0 * pi);
  };
  return integrate_slopes(stretched_a, stretched_b, 1e-10, integrand);
}

}  // namespace lobefit
