#include "reference/albedo.h"

#include <tbb/parallel_for.h>

#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <vector>

namespace lobefit {

namespace {

Rgb integrate(const std::function<Rgb(const Direction&, const Direction&)>& brdf, double theta, FixedDirection fixed,
              AlbedoDomain domain, int panels, Monitor& monitor) {
  const Direction still = direction(theta, 0.0);
  const int azimuths = 8 * panels;
  // Each panel is one term of a sum in fixed order.
  std::vector<Rgb> parts(static_cast<std::size_t>(panels));
  monitor.begin("albedo over " + std::to_string(panels) + " panels", static_cast<std::uint64_t>(panels));
  tbb::parallel_for(0, panels, [&](int panel) {
    const double width = (domain == AlbedoDomain::hemisphere ? 0.5 : 1.0) * pi / panels;
    Rgb sum;
    const auto ring = [&](double polar) {
      monitor.check();
      Rgb ring_sum;
      for (int k = 0; k < azimuths; ++k) {
        const Direction moving = direction(polar, 2.0 * pi * (k + 0.5) / azimuths);
        ring_sum = ring_sum + (fixed == FixedDirection::view ? brdf(moving, still) : brdf(still, moving));
      }
      const double cosine = domain == AlbedoDomain::fibre ? 1.0 : std::abs(std::cos(polar));
      return ring_sum * (2.0 * pi / azimuths * cosine * std::sin(polar));
    };
    using Rule = boost::math::quadrature::gauss<double, 7>;
    const double middle = (panel + 0.5) * width;
    for (std::size_t i = 0; i < Rule::abscissa().size(); ++i) {
      const double offset = 0.5 * width * Rule::abscissa()[i];
      const double weight = 0.5 * width * Rule::weights()[i];
      sum = sum + ring(middle + offset) * weight;
      if (offset > 0.0) sum = sum + ring(middle - offset) * weight;
    }
    parts[static_cast<std::size_t>(panel)] = sum;
    monitor.advance(1);
  });
  monitor.end();
  Rgb sum;
  for (const Rgb& part : parts) sum = sum + part;
  return sum;
}

}  // namespace

Albedo directional_albedo(const std::function<Rgb(const Direction&, const Direction&)>& brdf, double theta,
                          FixedDirection fixed, AlbedoDomain domain, double tolerance, Monitor* monitor) {
  Monitor silent;
  Monitor& watch = monitor ? *monitor : silent;
  // An even number of panels over a sphere has the horizon between two of them.
  Rgb coarse = integrate(brdf, theta, fixed, domain, domain == AlbedoDomain::hemisphere ? 1 : 2, watch);
  for (int panels = domain == AlbedoDomain::hemisphere ? 2 : 4;; panels *= 2) {
    const Rgb fine = integrate(brdf, theta, fixed, domain, panels, watch);
    const Rgb error{abs(fine.x - coarse.x), abs(fine.y - coarse.y), abs(fine.z - coarse.z)};
    const double worst = max(error.x, max(error.y, error.z));
    const double size = max(abs(fine.x), max(abs(fine.y), abs(fine.z)));
    if (worst <= tolerance * size || panels >= 256) return {fine, error};
    coarse = fine;
  }
}

Estimate estimate_albedo(const Integrator& integrator, double theta, FixedDirection fixed, AlbedoDomain domain,
                         const SamplingOptions& options, Monitor* monitor) {
  Monitor silent;
  Monitor& watch = monitor ? *monitor : silent;
  const Direction still = direction(theta, 0.0);
  // Directions at a time that share their paths.
  constexpr std::uint32_t batch = 64;
  const std::uint32_t batches = (options.per_replicate() + batch - 1) / batch;
  std::array<Rgb, replicate_count> means;
  watch.begin("albedo", replicate_count);
  tbb::parallel_for(std::size_t{0}, std::size_t{replicate_count}, [&](std::size_t r) {
    const auto replicate = static_cast<std::uint32_t>(r);
    const SamplePoints directions(options.sampler, {options.seed, 0, replicate});
    Rgb sum;
    std::array<Direction, batch> moving;
    std::array<Rgb, batch> values;
    for (std::uint32_t b = 0; b < batches; ++b) {
      watch.check();
      for (std::uint32_t k = 0; k < batch; ++k) {
        const auto [u, v] = directions(b * batch + k);
        // Density cosine/π, |cosine|/2π or 1/4π.
        const double z = domain == AlbedoDomain::fibre    ? 2.0 * u - 1.0
                         : domain == AlbedoDomain::sphere ? (u < 0.5 ? -std::sqrt(2.0 * u) : std::sqrt(2.0 * u - 1.0))
                                                          : std::sqrt(u);
        const double radius = std::sqrt((1.0 - z) * (1.0 + z));
        moving[k] = {radius * std::cos(2.0 * pi * v), radius * std::sin(2.0 * pi * v), z};
      }
      const SamplePoints points(options.sampler, {options.seed, std::uint64_t{b} + 1, replicate});
      if (fixed == FixedDirection::view) {
        integrator.sample_row(still, moving, points, batch, true, {.values = values});
      } else {
        for (std::uint32_t k = 0; k < batch; ++k) {
          const SamplePoints own(options.sampler, {options.seed, std::uint64_t{b} * batch + k + 1, replicate});
          integrator.sample_row(moving[k], {&still, 1}, own, 1, false, {.values = {&values[k], 1}});
        }
      }
      for (const Rgb& value : values) sum = sum + value;
    }
    const double measure = domain == AlbedoDomain::hemisphere ? pi
                           : domain == AlbedoDomain::sphere   ? 2.0 * pi
                                                              : 4.0 * pi;
    means[r] = sum * (measure / (std::uint64_t{batches} * batch));
    watch.advance(1);
  });
  watch.end();
  const auto summarise = [&](auto&& channel) {
    std::array<double, replicate_count> column;
    for (std::size_t r = 0; r < replicate_count; ++r) column[r] = channel(means[r]);
    return mean_and_error(std::span<const double>(column));
  };
  const MeanAndError red = summarise([](const Rgb&c) { return c.x; }),
                     green = summarise([](const Rgb&c) { return c.y; }),
                     blue = summarise([](const Rgb&c) { return c.z; });
  return {.f = {red.mean, green.mean, blue.mean},
          .stderr_f = {red.standard_error, green.standard_error, blue.standard_error},
          .samples = std::uint64_t{batches} * batch * replicate_count,
          .method = "monte_carlo"};
}

}  // namespace lobefit
