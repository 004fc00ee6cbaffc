#include "reference/layered/adding_doubling.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <boost/math/special_functions/legendre.hpp>
#include <functional>

#include "models/error.h"
#include "models/microfacet/fresnel.h"

namespace lobefit {

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// Channel -1: all, which are equal.
double channel_of(const Rgb& value, int channel) { return channel <= 0 ? value.x : channel == 1 ? value.y : value.z; }
void add_to_channel(Rgb& sum, int channel, double value) {
  if (channel < 0 || channel == 0) sum.x += value;
  if (channel < 0 || channel == 1) sum.y += value;
  if (channel < 0 || channel == 2) sum.z += value;
}

/// The streams of all media: q = n² sin²θ, and weights of dq/2. Lights and viewers come last.
struct Streams {
  std::vector<double> q, weight;
  std::size_t first_light = 0, first_viewer = 0;

  Eigen::Index size() const { return static_cast<Eigen::Index>(q.size()); }
  /// 0 where there is no such stream at that index: evanescent.
  double cosine(std::size_t s, double ior) const {
    const double rest = ior * ior - q[s];
    return rest > 0.0 ? std::sqrt(rest) / ior : 0.0;
  }
};

Streams make_streams(const LayerEvent& event, std::span<const double> cosines_i, std::span<const double> cosines_o,
                     int count) {
  std::vector<double> ends{0.0, 1.0};
  for (const LayerEvent::Boundary& boundary : event.boundaries) {
    for (const double ior : {boundary.ior_above, boundary.ior_below}) ends.push_back(ior * ior);
    // GGX has vertical facets, so that its refraction stops with a jump where only they are left: at equal n cos θ on
    // both sides, whatever the azimuth. For the directions asked for, no quadrature may run across it.
    const auto* interface = std::get_if<InterfaceLayer>(&boundary.layer);
    if (!interface || interface->alpha == 0.0) continue;
    const double jump = boundary.ior_below * boundary.ior_below - boundary.ior_above * boundary.ior_above;
    for (const std::span<const double> cosines : {cosines_i, cosines_o}) {
      for (const double cosine : cosines) ends.push_back(max((1.0 - cosine) * (1.0 + cosine) + jump, 0.0));
    }
  }
  std::sort(ends.begin(), ends.end());
  Streams streams;
  // Boost lists the zeros of P_n from 0 up.
  std::vector<double> zeros = boost::math::legendre_p_zeros<double>(count);
  for (std::size_t k = zeros.size(); k-- > 0;) {
    if (zeros[k] > 0.0) zeros.push_back(-zeros[k]);
  }
  for (std::size_t k = 0; k + 1 < ends.size(); ++k) {
    const double lower = ends[k], upper = ends[k + 1];
    if (upper - lower < 1e-12) continue;
    // q = upper (1 - t²), t in [0, √(1 - lower/upper)].
    const double half = 0.5 * std::sqrt(1.0 - lower / upper);
    for (const double x : zeros) {
      const double slope = boost::math::legendre_p_prime(count, x);
      const double t = half * (1.0 + x);
      streams.q.push_back(upper * (1.0 - t * t));
      streams.weight.push_back(half * 2.0 / ((1.0 - x * x) * slope * slope) * upper * t);
    }
  }
  // Weight so little that the others do not notice, and enough that a column is its kernel times it.
  constexpr double little = 1e-9;
  const auto append = [&](std::span<const double> cosines) {
    for (const double cosine : cosines) {
      streams.q.push_back((1.0 - cosine) * (1.0 + cosine));
      streams.weight.push_back(little);
    }
  };
  streams.first_light = streams.q.size();
  append(cosines_i);
  streams.first_viewer = streams.q.size();
  append(cosines_o);
  return streams;
}

/// What a layer does to the radiances of the streams that fall on it. Transmission includes what passes straight.
struct Layer {
  Matrix reflect_above, reflect_below, transmit_down, transmit_up;
};

/// ∫ kernel(φ) cos mφ dφ for every m < modes, by the trapezoidal rule, of an even function; φ between the directions
/// of travel.
std::vector<double> azimuthal_modes(const std::function<double(double)>& kernel, int modes, int points) {
  std::vector<double> result(static_cast<std::size_t>(modes), 0.0);
  for (int k = 0; k <= points; ++k) {
    const double phi = pi * k / points;
    const double value = kernel(phi) * (k == 0 || k == points ? 1.0 : 2.0) * (pi / points);
    for (int m = 0; m < modes; ++m) result[static_cast<std::size_t>(m)] += value * std::cos(m * phi);
  }
  return result;
}

/// One matrix per mode of kernel(s, t, φ), with the weights of the streams t that arrive.
template <class Kernel>
std::vector<Matrix> kernel_matrices(const Streams& streams, double ior_to, double ior_from, int modes, int points,
                                    Kernel&& kernel) {
  const Eigen::Index n = streams.size();
  std::vector<Matrix> result(static_cast<std::size_t>(modes), Matrix::Zero(n, n));
  for (Eigen::Index s = 0; s < n; ++s) {
    const double to = streams.cosine(static_cast<std::size_t>(s), ior_to);
    for (Eigen::Index t = 0; t < n; ++t) {
      const double from = streams.cosine(static_cast<std::size_t>(t), ior_from);
      if (!(to > 0.0 && from > 0.0)) continue;
      const std::vector<double> coefficients =
          azimuthal_modes([&](double phi) { return kernel(to, from, phi); }, modes, points);
      for (std::size_t m = 0; m < coefficients.size(); ++m) {
        result[m](s, t) = coefficients[m] * streams.weight[static_cast<std::size_t>(t)];
      }
    }
  }
  return result;
}

/// The cosine between two directions of travel; both cosines positive where they go the same way.
double travel_cosine(double a, double b, double phi) {
  return a * b + std::sqrt((1.0 - a * a) * (1.0 - b * b)) * std::cos(phi);
}

// ---- media ----------------------------------------------------------------------------------------------------

std::vector<Layer> medium_layers(const Streams& streams, double ior, double depth, double albedo, double g, int modes) {
  const auto n = streams.size();
  const auto count = static_cast<std::size_t>(modes);
  // From layers so thin that second scatterings do not count.
  int doublings = 0;
  double thin = depth;
  for (; thin > 1e-8; ++doublings) thin *= 0.5;
  const auto henyey_greenstein = [g](double cosine) {
    return (1.0 - g * g) / (4.0 * pi) * std::pow(1.0 + g * g - 2.0 * g * cosine, -1.5);
  };
  const int points = g == 0.0 ? 1 : 96;
  const int phase_modes = g == 0.0 ? 1 : modes;
  const double scale = albedo / (ior * ior);
  std::vector<Matrix> reflection =
      kernel_matrices(streams, ior, ior, phase_modes, points, [&](double to, double from, double phi) {
        return scale * henyey_greenstein(travel_cosine(-to, from, phi)) * -std::expm1(-thin * (1.0 / to + 1.0 / from)) /
               (to + from);
      });
  std::vector<Matrix> transmission =
      kernel_matrices(streams, ior, ior, phase_modes, points, [&](double to, double from, double phi) {
        const double x = thin / to, difference = thin * (1.0 / from - 1.0 / to);
        const double mean = difference == 0.0 ? 1.0 : -std::expm1(-difference) / difference;
        return scale * henyey_greenstein(travel_cosine(to, from, phi)) * std::exp(-x) * mean * thin / (to * from);
      });
  reflection.resize(count, Matrix::Zero(n, n));
  transmission.resize(count, Matrix::Zero(n, n));
  const auto direct = [&](double tau) {
    Vector result(n);
    for (Eigen::Index s = 0; s < n; ++s) {
      const double cosine = streams.cosine(static_cast<std::size_t>(s), ior);
      result(s) = cosine > 0.0 ? std::exp(-tau / cosine) : 0.0;
    }
    return result;
  };
  std::vector<Layer> layers;
  const Matrix identity = Matrix::Identity(n, n);
  for (std::size_t m = 0; m < count; ++m) {
    Matrix& r = reflection[m];
    Matrix& scattered =
        transmission[m];  // less what passes straight: next to that, thin layers would be lost in rounding
    if (m < static_cast<std::size_t>(phase_modes)) {
      double tau = thin;
      for (int k = 0; k < doublings; ++k, tau *= 2.0) {
        const Vector straight = direct(tau);
        Matrix t = scattered;
        t.diagonal() += straight;
        // T (1 - RR)⁻¹ T = T T + T (1 - RR)⁻¹ RR T, and R + T R (1 - RR)⁻¹ T.
        const Matrix rr = r * r;
        const Matrix returned = (identity - rr).partialPivLu().solve(rr * t);
        r += t * (r * (t + returned));
        scattered = straight.asDiagonal() * scattered + scattered * t + t * returned;
      }
    }
    Matrix t = scattered;
    t.diagonal() += direct(depth);
    layers.push_back({r, r, t, t});
  }
  return layers;
}

// ---- interfaces -----------------------------------------------------------------------------------------------

/// Smith's Λ for GGX.
double ggx_lambda(double alpha, double cosine) {
  const double tan2 = (1.0 - cosine * cosine) / (cosine * cosine);
  return 0.5 * (std::sqrt(1.0 + alpha * alpha * tan2) - 1.0);
}

double ggx_density(double alpha, double cosine) {
  const double d = 1.0 + (alpha * alpha - 1.0) * cosine * cosine;
  return alpha * alpha / (pi * d * d);
}

/// Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces, equation 20, over n², with
/// height-correlated masking; phi between the directions of travel, 0 for a mirror.
template <class Fresnel>
double facet_reflection(double alpha, double ior, double to, double from, double phi, Fresnel&& fresnel) {
  // The angle between -travel of the light and the viewer's direction.
  const double cosine2 = travel_cosine(to, from, pi - phi);
  const double length2 = 2.0 + 2.0 * cosine2;  // of wi + wo
  if (!(length2 > 1e-24)) return 0.0;
  const double facet = (to + from) / std::sqrt(length2);
  const double g2 = 1.0 / (1.0 + ggx_lambda(alpha, to) + ggx_lambda(alpha, from));
  return fresnel(std::min(1.0, 0.5 * std::sqrt(length2))) * ggx_density(alpha, facet) * g2 /
         (4.0 * to * from * ior * ior);
}

/// Ibid., equation 21: over n² of the side it leaves on, it is symmetric.
double facet_transmission(double alpha, double ior_to, double ior_from, double to, double from, double phi) {
  // Both as angles with the normal of the light's side: the viewer is beyond, at -to.
  const double between = -travel_cosine(to, from, phi);  // wi·wo
  const double length2 = ior_from * ior_from + ior_to * ior_to + 2.0 * ior_from * ior_to * between;
  if (!(length2 > 1e-24)) return 0.0;
  // m = ±(n_from wi + n_to wo)/length, towards the light's side.
  const double side = ior_from * from - ior_to * to > 0.0 ? 1.0 : -1.0;
  const double length = side * std::sqrt(length2);
  const double facet = (ior_from * from - ior_to * to) / length;
  const double m_from = (ior_from + ior_to * between) / length, m_to = -(ior_from * between + ior_to) / length;
  if (!(m_from > 0.0 && m_to > 0.0 && facet > 0.0)) return 0.0;
  const double fresnel = DielectricFresnel::evaluate(m_from, ior_to / ior_from);
  // Heights seen from both sides add up to one: B(1 + Λ, 1 + Λ') (Heitz et al. 2016).
  const double a = 1.0 + ggx_lambda(alpha, from), b = 1.0 + ggx_lambda(alpha, to);
  const double g2 = std::exp(std::lgamma(a) + std::lgamma(b) - std::lgamma(a + b));
  return m_from * m_to / (from * to) * (1.0 - fresnel) * g2 * ggx_density(alpha, facet) / length2;
}

/// Enough for the lobes of facets.
int lobe_points(double alpha) { return std::clamp(static_cast<int>(40.0 / alpha), 64, 512); }

std::vector<Layer> interface_layers(const Streams& streams, double above, double below, const InterfaceLayer& layer,
                                    int modes) {
  const Eigen::Index n = streams.size();
  const auto count = static_cast<std::size_t>(modes);
  if (layer.alpha == 0.0 || above == below) {
    Layer smooth{Matrix::Zero(n, n), Matrix::Zero(n, n), Matrix::Zero(n, n), Matrix::Zero(n, n)};
    for (Eigen::Index s = 0; s < n; ++s) {
      const double cosine_above = streams.cosine(static_cast<std::size_t>(s), above);
      const double cosine_below = streams.cosine(static_cast<std::size_t>(s), below);
      if (cosine_above > 0.0 && cosine_below > 0.0) {
        const double reflectance = DielectricFresnel::evaluate(cosine_above, below / above);
        smooth.reflect_above(s, s) = smooth.reflect_below(s, s) = reflectance;
        smooth.transmit_down(s, s) = smooth.transmit_up(s, s) = 1.0 - reflectance;
      } else {
        smooth.reflect_above(s, s) = cosine_above > 0.0 ? 1.0 : 0.0;
        smooth.reflect_below(s, s) = cosine_below > 0.0 ? 1.0 : 0.0;
      }
    }
    return std::vector<Layer>(count, smooth);
  }
  if (layer.all_bounces) {
    throw Error(ExitCode::usage, "adding-doubling knows rough interfaces with one bounce alone", "bounces",
                "set bounces to 1");
  }
  const int points = lobe_points(layer.alpha);
  const auto reflection = [&](double ior, double beyond) {
    return kernel_matrices(streams, ior, ior, modes, points, [&](double to, double from, double phi) {
      return facet_reflection(layer.alpha, ior, to, from, phi,
                              [&](double cosine) { return DielectricFresnel::evaluate(cosine, beyond / ior); });
    });
  };
  const auto transmission = [&](double ior_to, double ior_from) {
    return kernel_matrices(streams, ior_to, ior_from, modes, points, [&](double to, double from, double phi) {
      return facet_transmission(layer.alpha, ior_to, ior_from, to, from, phi);
    });
  };
  const std::vector<Matrix> reflect_above = reflection(above, below), reflect_below = reflection(below, above);
  const std::vector<Matrix> transmit_down = transmission(below, above), transmit_up = transmission(above, below);
  std::vector<Layer> layers;
  for (std::size_t m = 0; m < count; ++m) {
    layers.push_back({reflect_above[m], reflect_below[m], transmit_down[m], transmit_up[m]});
  }
  return layers;
}

/// Reflection of the bottom.
std::vector<Matrix> bottom_matrices(const Streams& streams, const LayerEvent::Boundary& bottom, int channel,
                                    int modes) {
  const Eigen::Index n = streams.size();
  const double ior = bottom.ior_above;
  std::vector<Matrix> result(static_cast<std::size_t>(modes), Matrix::Zero(n, n));
  if (const auto* diffuse = std::get_if<DiffuseLayer>(&bottom.layer)) {
    if (diffuse->alpha > 0.0) {
      throw Error(ExitCode::usage, "adding-doubling knows Lambertian bottoms alone", "alpha", "set alpha to 0");
    }
    const double kernel = channel_of(diffuse->albedo, channel) / (pi * ior * ior);
    result[0] = kernel_matrices(streams, ior, ior, 1, 1, [&](double, double, double) { return kernel; })[0];
  } else if (const auto* interface = std::get_if<InterfaceLayer>(&bottom.layer)) {
    const std::vector<Layer> layers = interface_layers(streams, ior, bottom.ior_below, *interface, modes);
    for (std::size_t m = 0; m < result.size(); ++m) result[m] = layers[m].reflect_above;
  } else if (const auto* conductor = std::get_if<ConductorLayer>(&bottom.layer)) {
    const double eta = channel_of(conductor->eta, channel) / ior, k = channel_of(conductor->k, channel) / ior;
    const double f0 = channel_of(conductor->f0, channel);
    const auto fresnel = [&](double cosine) {
      return conductor->by_f0 ? SchlickFresnel::evaluate(cosine, f0, 1.0) : ConductorFresnel::evaluate(cosine, eta, k);
    };
    if (conductor->alpha == 0.0) {
      for (Eigen::Index s = 0; s < n; ++s) {
        const double cosine = streams.cosine(static_cast<std::size_t>(s), ior);
        for (Matrix& matrix : result) matrix(s, s) = cosine > 0.0 ? fresnel(cosine) : 0.0;
      }
      return result;
    }
    if (conductor->all_bounces) {
      throw Error(ExitCode::usage, "adding-doubling knows rough conductors with one bounce alone", "bounces",
                  "set bounces to 1");
    }
    result = kernel_matrices(streams, ior, ior, modes, lobe_points(conductor->alpha),
                             [&](double to, double from, double phi) {
                               return facet_reflection(conductor->alpha, ior, to, from, phi, fresnel);
                             });
  }
  return result;
}

}  // namespace

AddingDoubling::AddingDoubling(const LayerStack& stack, std::span<const double> cosines_i,
                               std::span<const double> cosines_o, const AddingDoublingOptions& options) {
  modes_.assign(static_cast<std::size_t>(options.modes), std::vector<Rgb>(cosines_i.size() * cosines_o.size()));
  albedo_.resize(cosines_o.size());
  for (const LayerEvent& event : stack.events()) {
    if (event.grey()) {
      add_event(event, -1, cosines_i, cosines_o, options);
    } else {
      for (int channel = 0; channel < 3; ++channel) add_event(event, channel, cosines_i, cosines_o, options);
    }
  }
}

void AddingDoubling::add_event(const LayerEvent& event, int channel, std::span<const double> cosines_i,
                               std::span<const double> cosines_o, const AddingDoublingOptions& options) {
  const Streams streams = make_streams(event, cosines_i, cosines_o, options.streams);
  std::vector<Matrix> below = bottom_matrices(streams, event.boundaries.back(), channel, options.modes);
  const Matrix identity = Matrix::Identity(streams.size(), streams.size());
  const auto add = [&](const std::vector<Layer>& above) {
    for (std::size_t m = 0; m < below.size(); ++m) {
      const Layer& layer = above[m];
      const Matrix returned =
          (identity - below[m] * layer.reflect_below).partialPivLu().solve(below[m] * layer.transmit_down);
      below[m] = layer.reflect_above + layer.transmit_up * returned;
    }
  };
  for (std::size_t k = event.regions.size(); k-- > 0;) {
    const LayerEvent::Region& region = event.regions[k];
    const double depth = channel_of(region.optical_depth, channel);
    if (depth > 0.0) {
      add(medium_layers(streams, region.ior, depth, channel_of(region.albedo, channel), region.g, options.modes));
    }
    const LayerEvent::Boundary& boundary = event.boundaries[k];
    if (const auto* interface = std::get_if<InterfaceLayer>(&boundary.layer)) {
      add(interface_layers(streams, boundary.ior_above, boundary.ior_below, *interface, options.modes));
    }
  }
  for (std::size_t o = 0; o < cosines_o.size(); ++o) {
    const auto row = static_cast<Eigen::Index>(streams.first_viewer + o);
    for (std::size_t i = 0; i < cosines_i.size(); ++i) {
      const std::size_t column = streams.first_light + i;
      for (std::size_t m = 0; m < below.size(); ++m) {
        add_to_channel(
            modes_[m][i * cosines_o.size() + o], channel,
            event.probability * below[m](row, static_cast<Eigen::Index>(column)) / (2.0 * pi * streams.weight[column]));
      }
    }
    for (Eigen::Index s = 0; s < static_cast<Eigen::Index>(streams.first_light); ++s) {
      if (streams.q[static_cast<std::size_t>(s)] < 1.0) {
        add_to_channel(albedo_[o], channel, event.probability * below[0](row, s));
      }
    }
  }
}

Rgb AddingDoubling::value(std::size_t i, std::size_t o, double phi) const {
  // The azimuth between directions of travel is phi + 180°.
  Rgb sum = entry(0, i, o);
  for (std::size_t m = 1; m < modes_.size(); ++m) {
    sum = sum + entry(m, i, o) * (2.0 * std::cos(static_cast<double>(m) * (phi + pi)));
  }
  return sum;
}

}  // namespace lobefit
