#include "reference/specular/microfacet_specular.h"

#include <algorithm>
#include <cmath>

namespace lobefit {

namespace {

RoughInterface make_interface(const MicrofacetSpecular::Parameters<double>& p) {
  const Facets facets{.distribution = static_cast<Distribution>(p.distribution),
                      .alpha_x = p.alpha_x > 0.0 ? p.alpha_x : p.alpha,
                      .alpha_y = p.alpha_y > 0.0 ? p.alpha_y : p.alpha};
  const FacetReflectance reflectance = p.interface == 0.0   ? FacetReflectance::schlick(p.f0, p.f90)
                                       : p.interface == 1.0 ? FacetReflectance::conductor(p.eta, p.k)
                                                            : FacetReflectance::dielectric(p.ior);
  if (reflectance.transmits() && p.ior == 1.0) {
    throw Error(ExitCode::usage, "an interface between equal indices has no BRDF", "ior",
                "choose another index, such as 1.5");
  }
  return RoughInterface(facets, reflectance, p.bounces == 0.0 ? 1 : RoughInterface::all_bounces,
                        static_cast<InterfaceMasking>(p.masking));
}

}  // namespace

MicrofacetSpecularIntegrator::MicrofacetSpecularIntegrator(std::span<const double> flat)
    : interface_(make_interface(unflatten<MicrofacetSpecular, double>(flat))) {
  const double orientation = radians(unflatten<MicrofacetSpecular, double>(flat).orientation);
  cosine_ = std::cos(orientation), sine_ = std::sin(orientation);
}

void MicrofacetSpecularIntegrator::exact_row(const Direction& wo, std::span<const Direction> wi,
                                             const Line& line) const {
  if (interface_.bounces() > 1) {
    throw Error(ExitCode::usage, "all bounces have no closed form", "bounces", "set bounces=1, or sample");
  }
  sample_row(wo, wi, SamplePoints(Sampler::sobol, {}), 0, false, line);
}

void MicrofacetSpecularIntegrator::sample_row(const Direction& wo, std::span<const Direction> wi,
                                              const SamplePoints& points, std::uint32_t samples, bool /*fast*/,
                                              const Line& line) const {
  const Direction viewer = local(wo);
  const bool opaque = !interface_.reflectance().transmits();
  std::vector<RoughInterface::Target> targets;
  for (std::size_t j = 0; j < wi.size(); ++j) {
    const Direction light = local(wi[j]);
    targets.emplace_back(interface_, light);
    line.values[j] = interface_.evaluate_single(light, viewer);
  }
  if (!line.orders.empty()) {
    std::fill(line.orders.begin(), line.orders.end(), 0.0);
    const RoughInterface mirror(interface_.facets(), FacetReflectance::schlick({1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}), 1,
                                interface_.masking());
    for (std::size_t j = 0; j < wi.size(); ++j) {
      line.orders[j] = opaque ? mirror.evaluate_single(targets[j].to, viewer).x : line.values[j].x;
    }
  }
  if (interface_.bounces() == 1 || viewer.z == 0.0) return;

  std::vector<Rgb> sums(wi.size());
  std::vector<double> order_sums(line.orders.size());
  const auto add = [&](std::size_t j, int order, double share, const Rgb& reflectance) {
    sums[j] = sums[j] + reflectance * share;
    if (!line.orders.empty() && order <= orders()) {
      order_sums[static_cast<std::size_t>(order - 1) * wi.size() + j] += share * (opaque ? 1.0 : reflectance.x);
    }
  };
  const RoughInterface::Target eye(interface_, viewer);
  for (std::uint32_t k = 0; k < samples; ++k) {
    PathNumbers numbers(points, k);
    interface_.connect_walk(viewer, targets, numbers,
                            [&](std::size_t j, int order, double share, const Rgb& reflectance) {
                              add(j, order, share * interface_.reverse_factor(targets[j].to, viewer), reflectance);
                            });
    for (std::size_t j = 0; j < targets.size(); ++j) {
      if (targets[j].to.z == 0.0) continue;
      PathNumbers light_numbers(points, samples + k);
      interface_.connect_walk(
          targets[j].to, {&eye, 1}, light_numbers,
          [&](std::size_t, int order, double share, const Rgb& reflectance) { add(j, order, share, reflectance); });
    }
  }
  for (std::size_t j = 0; j < wi.size(); ++j) {
    line.values[j] = line.values[j] + sums[j] / static_cast<double>(samples);
    for (std::size_t at = j; at < line.orders.size(); at += wi.size()) line.orders[at] += order_sums[at] / samples;
  }
}

Reference microfacet_specular_reference() {
  using R = MicrofacetSpecular;
  return {.name = R::name,
          .doc = R::doc,
          .source = R::source,
          .parameters = describe_parameters<R>(),
          .sphere = true,
          .make = [](const ParameterValues& values) -> std::unique_ptr<const Integrator> {
            return std::make_unique<MicrofacetSpecularIntegrator>(values.flat());
          }};
}

}  // namespace lobefit
