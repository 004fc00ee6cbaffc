#include "reference/references.h"

#include <tbb/parallel_for.h>

#include <array>

#include "reference/microfacet_diffuse.h"

namespace lobefit {

namespace {

Reference make_microfacet_diffuse() {
  using R = MicrofacetDiffuse;
  return {.name = R::name,
          .doc = R::doc,
          .source = R::source,
          .parameters = describe_parameters<R>(),
          .exact =
              [](std::span<const double> flat, const Direction& wi, const Direction& wo) {
                return unflatten<R, double>(flat).albedo * MicrofacetDiffuseSurface(flat).exact(wi, wo);
              },
          .sample_row =
              [](std::span<const double> flat, const Direction& wo, std::span<const Direction> wi,
                 const SamplePoints& points, std::uint32_t samples, bool fast, std::span<Rgb> values) {
                const MicrofacetDiffuseSurface surface(flat);
                std::vector<double> row(wi.size());
                if (fast) {
                  surface.sample_row_fast(wo, wi, points, samples, row);
                } else {
                  surface.sample_row(wo, wi, points, samples, row);
                }
                const Rgb albedo = unflatten<R, double>(flat).albedo;
                for (std::size_t j = 0; j < row.size(); ++j) values[j] = albedo * row[j];
              }};
}

}  // namespace

std::span<const Reference> references() {
  static const std::array all{make_microfacet_diffuse()};
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

Estimate estimate(const Reference& reference, std::span<const double> flat, const Direction& wi, const Direction& wo,
                  const SamplingOptions& options, Monitor* monitor) {
  Monitor silent;
  Monitor& watch = monitor ? *monitor : silent;
  for (SamplingOptions current = options;; current.samples *= 2) {
    std::array<Rgb, replicate_count> means;
    watch.begin("reference " + std::string(reference.name), replicate_count);
    tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(replicate_count), [&](std::uint32_t r) {
      watch.check();
      reference.sample_row(flat, wo, {&wi, 1}, SamplePoints(options.sampler, {options.seed, 0, r}),
                           current.per_replicate(), false, {&means[r], 1});
      watch.advance(1);
    });
    watch.end();
    std::array<MeanAndError, 3> channel;
    double worst = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      std::array<double, replicate_count> column;
      for (std::size_t r = 0; r < replicate_count; ++r)
        column[r] = c == 0 ? means[r].x : c == 1 ? means[r].y : means[r].z;
      channel[c] = mean_and_error(std::span<const double>(column));
      worst = max(worst, channel[c].standard_error);
    }
    if (options.stderr_target > 0.0 && worst > options.stderr_target && current.samples * 2 <= most_samples) continue;
    return {.f = {channel[0].mean, channel[1].mean, channel[2].mean},
            .stderr_f = {channel[0].standard_error, channel[1].standard_error, channel[2].standard_error},
            .samples = std::uint64_t{current.per_replicate()} * replicate_count,
            .method = "monte_carlo"};
  }
}

}  // namespace lobefit
