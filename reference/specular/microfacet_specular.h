// Mirror-like and refracting microfacets: the reference behind specular lobes and their energy compensation.
#pragma once

#include "models/parameter.h"
#include "reference/integrator.h"
#include "reference/specular/rough_interface.h"

namespace lobefit {

struct MicrofacetSpecular {
  static constexpr std::string_view name = "microfacet_specular";
  static constexpr std::string_view doc =
      "Mirror facets (Schlick, conductor) or refracting ones (dielectric) under a GGX or Beckmann slope distribution "
      "with Smith masking, one bounce or all. Across a dielectric f is the radiance that leaves per irradiance.";
  static constexpr std::string_view source =
      "Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces; Heitz et al. 2016, "
      "Multiple-Scattering Microfacet BSDFs with the Smith Model";
  static constexpr std::array<std::string_view, 3> interfaces{"schlick", "conductor", "dielectric"};
  static constexpr std::array<std::string_view, 2> distributions{"ggx", "beckmann"};
  static constexpr std::array<std::string_view, 3> maskings{"correlated", "separable", "none"};
  static constexpr std::array<std::string_view, 2> bounce_choices{"1", "all"};

  template <class T>
  struct Parameters {
    T interface;
    T alpha, alpha_x, alpha_y, orientation;
    T distribution, masking, bounces;
    Vec3<T> f0, f90;
    Vec3<T> eta, k;
    T ior;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.interface, ParameterInfo{.name = "interface",
                                     .upper = 2.0,
                                     .doc = "Facets: schlick takes f0 and f90, conductor eta and k, dielectric ior.",
                                     .choices = interfaces});
    visit(p.alpha,
          ParameterInfo{.name = "alpha",
                        .symbol = "α",
                        .lower = 0.001,
                        .upper = 1.0,
                        .initial = 0.5,
                        .doc = "Roughness of the slope distribution: GGX alpha, or √2 times Beckmann's rms slope."});
    visit(p.alpha_x, ParameterInfo{.name = "alpha_x",
                                   .symbol = "α_x",
                                   .upper = 1.0,
                                   .doc = "Roughness along the direction `orientation`, at least 1e-4; 0: alpha."});
    visit(p.alpha_y,
          ParameterInfo{
              .name = "alpha_y", .symbol = "α_y", .upper = 1.0, .doc = "Roughness across it, likewise; 0: alpha."});
    visit(p.orientation, ParameterInfo{.name = "orientation",
                                       .unit = "deg",
                                       .lower = -180.0,
                                       .upper = 180.0,
                                       .doc = "Azimuth of the direction along which alpha_x holds."});
    visit(p.distribution, ParameterInfo{.name = "distribution",
                                        .upper = 1.0,
                                        .doc = "Slope distribution of the facets.",
                                        .choices = distributions});
    visit(p.masking, ParameterInfo{.name = "masking",
                                   .upper = 2.0,
                                   .doc = "Smith masking and shadowing; all bounces take correlated.",
                                   .choices = maskings});
    visit(p.bounces,
          ParameterInfo{
              .name = "bounces", .upper = 1.0, .doc = "Scattering orders between facets.", .choices = bounce_choices});
    visit(p.f0, ParameterInfo{.name = "f0", .symbol = "F0", .initial = 1.0, .doc = "Reflectance at normal incidence."});
    visit(p.f90,
          ParameterInfo{.name = "f90", .symbol = "F90", .initial = 1.0, .doc = "Reflectance at grazing angles."});
    visit(p.eta, ParameterInfo{
                     .name = "eta",
                     .symbol = "η",
                     .upper = 20.0,
                     .initial = 0.2,
                     .doc = "Real part of the conductor's index over that of the medium above (default: gold-like)."});
    visit(p.k, ParameterInfo{.name = "k",
                             .symbol = "k",
                             .upper = 20.0,
                             .initial = 3.0,
                             .doc = "Imaginary part of the conductor's index, likewise."});
    visit(p.ior, ParameterInfo{.name = "ior",
                               .symbol = "n",
                               .lower = 0.25,
                               .upper = 4.0,
                               .initial = 1.5,
                               .doc = "Dielectric: index below the surface over the index above it."});
  }
};

/// The reference with its parameters.
class MicrofacetSpecularIntegrator : public Integrator {
 public:
  /// Throws Error(usage): see RoughInterface; also for an index of 1, whose BRDF is a delta function.
  explicit MicrofacetSpecularIntegrator(std::span<const double> flat);

  int channels() const override { return interface_.reflectance().grey() ? 1 : 3; }
  /// Orders kept apart: the first 16 bounces. Opaque facets: what a bounce adds were their reflectance 1 for every
  /// angle, so that f = Σ Fⁿ f_n for a constant reflectance F. Dielectric facets: what it adds as they are.
  int orders() const override { return interface_.bounces() == 1 ? 1 : 16; }
  bool has_exact() const override { return interface_.bounces() == 1; }
  /// One bounce, in closed form; throws Error(usage) for all bounces.
  void exact_row(const Direction& wo, std::span<const Direction> wi, const Line& line) const override;
  /// The first bounce in closed form; the others by a walk from the viewer, connected to every light, and one from
  /// each light, connected to the viewer: see RoughInterface::connect_walk.
  void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points, std::uint32_t samples,
                  bool fast, const Line& line) const override;

  const RoughInterface& interface() const { return interface_; }

 private:
  Direction local(const Direction& w) const { return {cosine_ * w.x + sine_ * w.y, cosine_ * w.y - sine_ * w.x, w.z}; }

  RoughInterface interface_;
  double cosine_, sine_;  // of the orientation
};

}  // namespace lobefit
