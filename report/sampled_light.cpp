#include "report/sampled_light.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "models/error.h"
#include "report/image.h"
#include "report/lighting.h"

namespace lobefit {

namespace {

/// The first sum above u times the whole; `u` becomes the position inside that step.
std::size_t pick(std::span<const double> sums, double& u) {
  const double target = u * sums.back();
  auto k = static_cast<std::size_t>(std::upper_bound(sums.begin(), sums.end(), target) - sums.begin());
  // Rounding may leave the target at the whole.
  k = std::min(k, sums.size() - 1);
  const double before = k == 0 ? 0.0 : sums[k - 1], step = sums[k] - before;
  u = step > 0.0 ? std::clamp((target - before) / step, 0.0, 1.0) : 0.5;
  return k;
}

}  // namespace

DiskLight::DiskLight(double theta, double phi, double radius) : axis_(direction_in_picture(theta, phi)) {
  if (!(radius > 0.0 && radius <= 90.0)) {
    throw Error(ExitCode::usage, fmt::format("a disk of radius {}", radius), "--area",
                "choose above 0 up to 90 degrees");
  }
  const Direction aside = std::abs(axis_.x) < 0.5 ? Direction{1.0, 0.0, 0.0} : Direction{0.0, 1.0, 0.0};
  across_ = normalize(cross(aside, axis_));
  up_ = cross(axis_, across_);
  cosine_ = std::cos(radians(radius));
  one_minus_cosine_ = 2.0 * square(std::sin(0.5 * radians(radius)));
}

ArrivingLight DiskLight::at(const Direction& w) const {
  if (dot(w, axis_) < cosine_) return {Rgb{}, 0.0};
  // Irradiance on a surface that faces the disk: radiance × π sin² radius.
  const double value = 1.0 / (one_minus_cosine_ * (1.0 + cosine_));
  return {Rgb{value, value, value}, 1.0 / (2.0 * pi * one_minus_cosine_)};
}

Direction DiskLight::sample(const std::array<double, 2>& u) const {
  const double missing = u[0] * one_minus_cosine_, sine = sqrt(missing * (2.0 - missing)), azimuth = 2.0 * pi * u[1];
  return across_ * (sine * std::cos(azimuth)) + up_ * (sine * std::sin(azimuth)) + axis_ * (1.0 - missing);
}

EnvironmentMap::EnvironmentMap(std::span<const float> rgb, std::size_t width, std::size_t height, double rotation,
                               const std::string& place)
    : width_(width), height_(height), rotation_(radians(rotation)), radiance_(3 * width * height) {
  if (height == 0 || width != 2 * height) {
    throw Error(ExitCode::invalid_input,
                fmt::format("a picture of {} x {} pixels shows no whole sphere", width, height), place,
                "use a lat-long (equirectangular) picture, twice as wide as high");
  }
  for (std::size_t line = 0; line < height; ++line) {
    double sum = 0.0;
    for (std::size_t column = 0; column < width; ++column) {
      const float* at = &rgb[3 * (line * width + column)];
      if (!std::isfinite(at[0] + at[1] + at[2])) {
        throw Error(ExitCode::invalid_input, "the radiance is not finite",
                    fmt::format("{}, column {}, line {}", place, column, line), "mend the picture there");
      }
      double light = 0.0;
      for (std::size_t c = 0; c < 3; ++c) {
        radiance_[3 * (line * width + column) + c] = std::max(at[c], 0.0f);
        light += std::max(at[c], 0.0f);
      }
      sum += light * solid_angle(line);
      pixel_sums_.push_back(sum);
    }
    line_sums_.push_back((line == 0 ? 0.0 : line_sums_.back()) + sum);
  }
  if (!(line_sums_.back() > 0.0)) {
    throw Error(ExitCode::invalid_input, "the picture is black", place, "use one that sends light");
  }
}

double EnvironmentMap::solid_angle(std::size_t line) const {
  const double step = pi / static_cast<double>(height_), top = static_cast<double>(line) * step;
  return 2.0 * pi / static_cast<double>(width_) * (std::cos(top) - std::cos(top + step));
}

std::size_t EnvironmentMap::pixel(const Direction& w) const {
  const double longitude = std::atan2(w.x, w.z) - rotation_;
  const double across = 0.5 - longitude / (2.0 * pi), down = std::acos(std::clamp(w.y, -1.0, 1.0)) / pi;
  const auto column = static_cast<std::size_t>((across - std::floor(across)) * static_cast<double>(width_));
  const auto line = static_cast<std::size_t>(down * static_cast<double>(height_));
  return std::min(line, height_ - 1) * width_ + std::min(column, width_ - 1);
}

ArrivingLight EnvironmentMap::at(const Direction& w) const {
  const float* at = &radiance_[3 * pixel(w)];
  const Rgb value{at[0], at[1], at[2]};
  return {value, (value.x + value.y + value.z) / line_sums_.back()};
}

Direction EnvironmentMap::sample(const std::array<double, 2>& u) const {
  double across = u[0], down = u[1];
  const std::size_t line = pick(line_sums_, down);
  const std::size_t column = pick(std::span(pixel_sums_).subspan(line * width_, width_), across);
  const double step = pi / static_cast<double>(height_), top = std::cos(static_cast<double>(line) * step),
               bottom = std::cos(static_cast<double>(line + 1) * step);
  const double y = std::lerp(top, bottom, down), radius = sqrt(1.0 - y * y);
  const double longitude =
      2.0 * pi * (0.5 - (static_cast<double>(column) + across) / static_cast<double>(width_)) + rotation_;
  return {radius * std::sin(longitude), y, radius * std::cos(longitude)};
}

EnvironmentMap read_environment(const std::filesystem::path& path, double rotation) {
  const LinearPicture picture = read_picture(path);
  return {picture.rgb, picture.width, picture.height, rotation, path.string()};
}

}  // namespace lobefit
