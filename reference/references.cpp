#include "reference/references.h"

#include <tbb/parallel_for.h>

#include <array>
#include <vector>

namespace lobefit {

void Integrator::exact_row(const Direction&, std::span<const Direction>, const Line&) const {
  throw Error(ExitCode::usage, "these parameters of the reference have no deterministic method", "",
              "let Monte Carlo give the value with its error: `lobefit reference` or `render` without --exact");
}

std::span<const Reference> references() {
  static const std::array all{microfacet_diffuse_reference(), microfacet_specular_reference(), layered_reference(),
                              hair_reference()};
  return all;
}

const Reference* find_reference_or_null(std::string_view name) {
  for (const Reference& reference : references()) {
    if (reference.name == name) return &reference;
  }
  return nullptr;
}

const Reference& find_reference(std::string_view name) {
  if (const Reference* reference = find_reference_or_null(name)) return *reference;
  std::vector<std::string> names;
  for (const Reference& reference : references()) names.emplace_back(reference.name);
  throw Error(ExitCode::usage, "unknown reference '" + std::string(name) + "'", "",
              "did you mean '" + nearest_name(name, names) + "'? `lobefit references` lists them all");
}

std::uint32_t SamplingOptions::per_replicate() const {
  return static_cast<std::uint32_t>((samples + replicate_count - 1) / replicate_count);
}

Estimate estimate(const Integrator& integrator, const Direction& wi, const Direction& wo,
                  const SamplingOptions& options, Monitor* monitor) {
  Monitor silent;
  Monitor& watch = monitor ? *monitor : silent;
  const auto orders = static_cast<std::size_t>(integrator.orders());
  for (SamplingOptions current = options;; current.samples *= 2) {
    std::array<Rgb, replicate_count> means;
    std::vector<double> order_means(replicate_count * orders);
    watch.begin("reference", replicate_count);
    tbb::parallel_for(std::size_t{0}, std::size_t{replicate_count}, [&](std::size_t r) {
      watch.check();
      integrator.sample_row(wo, {&wi, 1},
                            SamplePoints(options.sampler, {options.seed, 0, static_cast<std::uint32_t>(r)}),
                            current.per_replicate(), false,
                            {.values = {&means[r], 1}, .orders = std::span(order_means).subspan(r * orders, orders)});
      watch.advance(1);
    });
    watch.end();
    const auto summarise = [&](auto&& replicate) {
      std::array<double, replicate_count> column;
      for (std::size_t r = 0; r < replicate_count; ++r) column[r] = replicate(r);
      return mean_and_error(std::span<const double>(column));
    };
    const MeanAndError red = summarise([&](std::size_t r) { return means[r].x; }),
                       green = summarise([&](std::size_t r) { return means[r].y; }),
                       blue = summarise([&](std::size_t r) { return means[r].z; });
    const double worst = max(red.standard_error, max(green.standard_error, blue.standard_error));
    if (options.stderr_target > 0.0 && worst > options.stderr_target && current.samples * 2 <= most_samples) continue;
    Estimate result{.f = {red.mean, green.mean, blue.mean},
                    .stderr_f = {red.standard_error, green.standard_error, blue.standard_error},
                    .samples = std::uint64_t{current.per_replicate()} * replicate_count,
                    .method = "monte_carlo"};
    for (std::size_t n = 0; n < orders; ++n) {
      result.orders.push_back(summarise([&](std::size_t r) { return order_means[r * orders + n]; }));
    }
    return result;
  }
}

}  // namespace lobefit
