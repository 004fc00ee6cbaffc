// Light that Lambertian microfacets scatter once: the reference behind rough diffuse models.
//
//   f = ρ/(π μi μo) ∫ (wi·m)⁺ (wo·m)⁺ G2(wi, wo) D(m) dm                       (Heitz, Dupuy 2015)
//
// Smith's G2 does not depend on m once the visible sides are in the integrand, so all maskings share one kernel
// K(wi, wo) = ∫ (wi·m)⁺ (wo·m)⁺ D dm.
#pragma once

#include <span>

#include "models/microfacet/distribution.h"
#include "models/model.h"
#include "reference/estimate.h"
#include "reference/sample_points.h"

namespace lobefit {

enum class Masking {
  correlated,  // G2 = 1/(1 + Λi + Λo): height-correlated Smith
  separable,   // G1(wi) G1(wo)
  view_only,   // G1(wo): the view sees visible normals, the light is not shadowed
  none,        // 1
  area_mean,   // view-independent: ∫ D (m·n) (m·wi)⁺ dm in K's place, f = ρ/(π μi) of it
};

struct MicrofacetDiffuse {
  static constexpr std::string_view name = "microfacet_diffuse";
  static constexpr std::string_view doc =
      "Lambertian facets under a GGX or Beckmann slope distribution with Smith masking, one bounce.";
  static constexpr std::string_view source =
      "Heitz, Dupuy 2015, Implementing a Simple Anisotropic Rough Diffuse Material";
  static constexpr std::array<std::string_view, 2> distributions{"ggx", "beckmann"};
  static constexpr std::array<std::string_view, 5> maskings{"correlated", "separable", "view_only", "none",
                                                            "area_mean"};
  static constexpr std::array<std::string_view, 1> bounce_choices{"1"};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T alpha;
    T distribution;
    T masking;
    T bounces;
  };

  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.albedo, albedo_parameter);
    visit(p.alpha,
          ParameterInfo{.name = "alpha",
                        .symbol = "α",
                        .lower = 0.001,
                        .upper = 1.0,
                        .initial = 0.5,
                        .doc = "Roughness of the slope distribution: GGX alpha, or √2 times Beckmann's rms slope."});
    visit(p.distribution, ParameterInfo{.name = "distribution",
                                        .upper = 1.0,
                                        .doc = "Slope distribution of the facets.",
                                        .choices = distributions});
    visit(p.masking,
          ParameterInfo{.name = "masking",
                        .upper = 4.0,
                        .doc = "Smith masking and shadowing; area_mean is the view-independent mean over the surface.",
                        .choices = maskings});
    visit(p.bounces,
          ParameterInfo{
              .name = "bounces", .upper = 0.0, .doc = "Scattering orders between facets.", .choices = bounce_choices});
  }
};

/// One surface of the reference, ready to be integrated.
class MicrofacetDiffuseSurface {
 public:
  explicit MicrofacetDiffuseSurface(std::span<const double> flat);

  /// BRDF per unit albedo by quadrature; relative error estimate below 1e-11 where f is not vanishing.
  double exact(const Direction& wi, const Direction& wo) const;

  /// Means over `samples` facets of one stream of the BRDFs per unit albedo of every wi, in double.
  void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points, std::uint32_t samples,
                  std::span<double> values) const;

  /// The same with facets and sums in float, vectorised over wi: relative error 1e-6, for tables of many directions.
  void sample_row_fast(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points,
                       std::uint32_t samples, std::span<double> values) const;

 private:
  /// The direction whose visible normals are sampled: wo, or the normal for area_mean.
  Direction seen_from(const Direction& wo) const;
  /// f per unit albedo = weight × E[(wi·m)⁺] over those normals.
  double weight(const Direction& wi, const Direction& wo) const;

  Distribution distribution_;
  Masking masking_;
  double alpha_;
};

/// K(a, b) = ∫ (a·m)⁺ (b·m)⁺ D(m) dm of an isotropic distribution, by quadrature: the azimuth of m in closed form
/// over the arcs where both sides are visible, the slope numerically between the slopes where those arcs change.
double shared_visibility(Distribution distribution, double alpha, const Direction& a, const Direction& b);

}  // namespace lobefit
