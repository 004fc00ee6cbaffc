#include "report/flip.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <numeric>

#include "models/scalar.h"

namespace lobefit {

namespace {

/// One number per pixel.
struct Channel {
  int width, height;
  std::vector<double> values;

  double clamped(int x, int y) const {
    return values[static_cast<std::size_t>(std::clamp(y, 0, height - 1)) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(std::clamp(x, 0, width - 1))];
  }
};

/// Weights from -radius to radius.
using Kernel = std::vector<double>;

template <class Weight>
Kernel kernel(int radius, Weight&& weight) {
  Kernel weights;
  for (int x = -radius; x <= radius; ++x) weights.push_back(weight(static_cast<double>(x)));
  return weights;
}

/// All filters are products of one across and one down. The picture goes on as its edge.
Channel filtered(const Channel& channel, const Kernel& across, const Kernel& down) {
  const auto pass = [](const Channel& from, const Kernel& weights, int step_x, int step_y) {
    Channel to{from.width, from.height, std::vector<double>(from.values.size())};
    const int radius = static_cast<int>(weights.size() / 2);
    tbb::parallel_for(0, from.height, [&](int y) {
      for (int x = 0; x < from.width; ++x) {
        double sum = 0.0;
        for (int k = -radius; k <= radius; ++k) {
          sum += weights[static_cast<std::size_t>(k + radius)] * from.clamped(x + k * step_x, y + k * step_y);
        }
        to.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(from.width) + static_cast<std::size_t>(x)] =
            sum;
      }
    });
    return to;
  };
  return pass(pass(channel, across, 1, 0), down, 0, 1);
}

// ---- colours: XYZ relative to D65, each 1 at white --------------------------------------------------------------

constexpr Rgb white{0.950428545, 1.0, 1.088900371};

Rgb xyz_of_rgb(const Rgb& c) {
  return Rgb{(10135552.0 * c.x + 8788810.0 * c.y + 4435075.0 * c.z) / 24577794.0,
             (2613072.0 * c.x + 8788810.0 * c.y + 887015.0 * c.z) / 12288897.0,
             (1425312.0 * c.x + 8788810.0 * c.y + 70074185.0 * c.z) / 73733382.0} /
         white;
}
Rgb rgb_of_xyz(const Rgb& relative) {
  const Rgb c = relative * white;
  return {3.241003275 * c.x - 1.537398934 * c.y - 0.498615861 * c.z,
          -0.969224334 * c.x + 1.875930071 * c.y + 0.041554224 * c.z,
          0.055639423 * c.x - 0.204011202 * c.y + 1.057148933 * c.z};
}
/// Lightness and two opponent axes from three responses.
Rgb opponent(const Rgb& c) { return {116.0 * c.y - 16.0, 500.0 * (c.x - c.y), 200.0 * (c.y - c.z)}; }
/// YCxCz: opponent axes of XYZ itself, in which blur is linear.
Rgb ycxcz_of_rgb(const Rgb& c) { return opponent(xyz_of_rgb(c)); }
Rgb rgb_of_ycxcz(const Rgb& c) {
  const double y = (c.x + 16.0) / 116.0;
  return rgb_of_xyz({y + c.y / 500.0, y, y - c.z / 200.0});
}
/// CIELAB with Hunt's effect: chroma fades in the dark.
Rgb hunt_lab(const Rgb& c) {
  const auto response = [](double t) {
    constexpr double delta = 6.0 / 29.0;
    return t > delta * delta * delta ? std::cbrt(t) : t / (3.0 * delta * delta) + 4.0 / 29.0;
  };
  const Rgb xyz = xyz_of_rgb(c);
  const Rgb lab = opponent({response(xyz.x), response(xyz.y), response(xyz.z)});
  return {lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z};
}
double hyab(const Rgb& a, const Rgb& b) {
  const Rgb d = a - b;
  return std::abs(d.x) + std::hypot(d.y, d.z);
}

// ---- filters ----------------------------------------------------------------------------------------------------

struct Gaussian {
  double a, b;  // a √(π/b) exp(-π² θ²/b), θ in degrees
};

/// The eye's blur: contrast sensitivity as a sum of Gaussians over the angle, with weights summing to 1.
Channel blurred(const Channel& channel, std::initializer_list<Gaussian> gaussians, double pixels_per_degree) {
  constexpr double widest = 0.04;  // of all channels, so that kernels are alike
  const int radius = static_cast<int>(std::ceil(3.0 * std::sqrt(widest / (2.0 * pi * pi)) * pixels_per_degree));
  Channel result{channel.width, channel.height, std::vector<double>(channel.values.size(), 0.0)};
  double total = 0.0;
  for (const Gaussian& g : gaussians) {
    const Kernel one = kernel(radius, [&](double x) { return std::exp(-square(pi * x / pixels_per_degree) / g.b); });
    const Channel part = filtered(channel, one, one);
    const double height = g.a * std::sqrt(pi / g.b);
    for (std::size_t k = 0; k < part.values.size(); ++k) result.values[k] += height * part.values[k];
    total += height * square(std::accumulate(one.begin(), one.end(), 0.0));
  }
  for (double& value : result.values) value /= total;
  return result;
}

enum class Feature { edge, point };

/// Strength of edges or points: first or second derivatives of a Gaussian across and down, positive and negative
/// weights each of sum 1.
std::vector<double> strength(const Channel& luminance, Feature feature, double pixels_per_degree) {
  constexpr double width = 0.082;  // degrees, twice the standard deviation
  const double deviation = 0.5 * width * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3.0 * deviation));
  const auto gaussian = [&](double x) { return std::exp(-x * x / (2.0 * square(deviation))); };
  Kernel along = kernel(
      radius, [&](double x) { return gaussian(x) * (feature == Feature::edge ? -x : square(x / deviation) - 1.0); });
  Kernel aside = kernel(radius, gaussian);
  const double sum = std::accumulate(aside.begin(), aside.end(), 0.0);
  for (double& weight : aside) weight /= sum;
  double positive = 0.0, negative = 0.0;
  for (const double weight : along) (weight > 0.0 ? positive : negative) += std::abs(weight);
  for (double& weight : along) weight /= weight > 0.0 ? positive : negative;
  const Channel x = filtered(luminance, along, aside), y = filtered(luminance, aside, along);
  std::vector<double> result(luminance.values.size());
  for (std::size_t k = 0; k < result.size(); ++k) result[k] = std::hypot(x.values[k], y.values[k]);
  return result;
}

// ---- the two pipelines ------------------------------------------------------------------------------------------

struct Seen {
  std::vector<Rgb> colour;          // after the eye's blur, in Hunt's CIELAB
  std::vector<double> edge, point;  // strength
};

Seen see(std::span<const float> rgb, int width, int height, double pixels_per_degree) {
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::array<Channel, 3> opponents;
  for (Channel& channel : opponents) channel = {width, height, std::vector<double>(pixels)};
  for (std::size_t k = 0; k < pixels; ++k) {
    const Rgb c = ycxcz_of_rgb(
        {saturate(double{rgb[3 * k]}), saturate(double{rgb[3 * k + 1]}), saturate(double{rgb[3 * k + 2]})});
    opponents[0].values[k] = c.x;
    opponents[1].values[k] = c.y;
    opponents[2].values[k] = c.z;
  }
  Channel luminance = opponents[0];
  for (double& value : luminance.values) value = (value + 16.0) / 116.0;
  Seen seen{.colour = std::vector<Rgb>(pixels),
            .edge = strength(luminance, Feature::edge, pixels_per_degree),
            .point = strength(luminance, Feature::point, pixels_per_degree)};
  const Channel light = blurred(opponents[0], {{1.0, 0.0047}}, pixels_per_degree),
                red_green = blurred(opponents[1], {{1.0, 0.0053}}, pixels_per_degree),
                blue_yellow = blurred(opponents[2], {{34.1, 0.04}, {13.5, 0.025}}, pixels_per_degree);
  for (std::size_t k = 0; k < pixels; ++k) {
    const Rgb c = rgb_of_ycxcz({light.values[k], red_green.values[k], blue_yellow.values[k]});
    seen.colour[k] = hunt_lab({saturate(c.x), saturate(c.y), saturate(c.z)});
  }
  return seen;
}

/// Differences up to two fifths of the largest take 95 % of the range.
double colour_error(const Rgb& a, const Rgb& b) {
  constexpr double exponent = 0.7, knee = 0.4, height = 0.95;
  static const double largest = std::pow(hyab(hunt_lab({0.0, 1.0, 0.0}), hunt_lab({0.0, 0.0, 1.0})), exponent);
  const double error = std::pow(hyab(a, b), exponent);
  return error < knee * largest ? height * error / (knee * largest)
                                : height + (error - knee * largest) / (largest - knee * largest) * (1.0 - height);
}

}  // namespace

std::vector<double> flip_errors(std::span<const float> a, std::span<const float> b, int width, int height,
                                double pixels_per_degree) {
  const Seen first = see(a, width, height, pixels_per_degree), second = see(b, width, height, pixels_per_degree);
  std::vector<double> errors(first.colour.size());
  for (std::size_t k = 0; k < errors.size(); ++k) {
    const double feature =
        std::max(std::abs(first.edge[k] - second.edge[k]), std::abs(first.point[k] - second.point[k]));
    errors[k] = std::pow(colour_error(first.colour[k], second.colour[k]), 1.0 - std::sqrt(std::sqrt(0.5) * feature));
  }
  return errors;
}

}  // namespace lobefit
