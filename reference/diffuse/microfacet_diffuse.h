// Light that diffuse microfacets scatter, once or until it leaves: the reference behind rough diffuse models.
//
//   f = ρ/(π μi μo) ∫ (wi·m)⁺ (wo·m)⁺ G2(wi, wo) D(m) dm                       (Heitz, Dupuy 2015)
//
// Smith's G2 does not depend on m once the visible sides are in the integrand, so all maskings share one kernel
// K(wi, wo) = ∫ (wi·m)⁺ (wo·m)⁺ D dm.
#pragma once

#include <memory>
#include <mutex>

#include "models/callisto/modulation.h"
#include "models/microfacet/distribution.h"
#include "models/model.h"
#include "reference/integrator.h"

namespace lobefit {

class SmithOrders;

enum class Masking {
  correlated,  // G2 = 1/(1 + Λi + Λo): height-correlated Smith
  separable,   // G1(wi) G1(wo)
  view_only,   // G1(wo): the view sees visible normals, the light is not shadowed
  none,        // 1
  area_mean,   // view-independent: ∫ D (m·n) (m·wi)⁺ dm in K's place, f = ρ/(π μi) of it
};

enum class FacetKind {
  lambert,
  interfaced,  // a Lambertian body under a smooth dielectric (Simonot 2009; Meneveaux et al. 2018)
  callisto,    // Callisto's c1 on Lambert, at every facet: what the slides call the correct, supersampled form
};

struct MicrofacetDiffuse {
  static constexpr std::string_view name = "microfacet_diffuse";
  static constexpr std::string_view doc =
      "Diffuse facets under a GGX or Beckmann slope distribution with Smith masking, one bounce or all of them.";
  static constexpr std::string_view source =
      "Heitz, Dupuy 2015, Implementing a Simple Anisotropic Rough Diffuse Material; Heitz, Hanika, d'Eon, Dachsbacher "
      "2016, Multiple-Scattering Microfacet BSDFs with the Smith Model";
  static constexpr std::array<std::string_view, 2> distributions{"ggx", "beckmann"};
  static constexpr std::array<std::string_view, 5> maskings{"correlated", "separable", "view_only", "none",
                                                            "area_mean"};
  static constexpr std::array<std::string_view, 9> bounce_choices{"1", "2", "3", "4", "5", "6", "7", "8", "all"};
  static constexpr std::array<std::string_view, 3> facet_kinds{"lambert", "interfaced", "callisto"};

  template <class T>
  struct Parameters {
    Vec3<T> albedo;
    T alpha, alpha_x, alpha_y, orientation;
    T distribution, masking, bounces, facet;
    T eta;
    CallistoModulation<T> callisto;
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
    visit(p.alpha_x, ParameterInfo{.name = "alpha_x", .symbol = "α_x", .doc = "Roughness along x; 0: as alpha."});
    visit(p.alpha_y, ParameterInfo{.name = "alpha_y", .symbol = "α_y", .doc = "Roughness along y; 0: as alpha."});
    visit(
        p.orientation,
        ParameterInfo{
            .name = "orientation", .unit = "degree", .lower = -180.0, .upper = 180.0, .doc = "Azimuth of the x axis."});
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
              .name = "bounces", .upper = 8.0, .doc = "Scattering orders between facets.", .choices = bounce_choices});
    visit(p.facet, ParameterInfo{.name = "facet",
                                 .upper = 2.0,
                                 .doc = "What a facet is: Lambert, Lambert under a smooth interface (its mirror "
                                        "reflection is left to microfacet_specular), or Callisto's c1 on Lambert.",
                                 .choices = facet_kinds});
    visit(p.eta, ParameterInfo{.name = "eta",
                               .symbol = "η",
                               .lower = 1.0,
                               .upper = 3.0,
                               .initial = 1.5,
                               .doc = "Refractive index of the body of interfaced facets."});
    describe_callisto_modulation(p.callisto, visit);
  }
};

/// One facet. Albedo enters as a factor per bounce: ρ itself, or for interfaced facets the body's albedo
/// ρ (1 - F_i)/(1 - ρ F_i), F_i the mean internal reflectance.
class DiffuseFacet {
 public:
  explicit DiffuseFacet(const MicrofacetDiffuse::Parameters<double>& p);

  FacetKind kind() const { return kind_; }
  double body_albedo(double rho) const;
  /// π times the facet's BRDF of the body, per unit of body albedo.
  double body(double cos_i, double cos_o, double cos_h, double cos_d) const;
  double body(const Direction& wi, const Direction& wo, const Direction& m) const;
  /// What the interface reflects at `cosine`; 0 without one.
  double mirror(double cosine) const;

 private:
  FacetKind kind_;
  double eta_, external_mean_ = 0.0, internal_mean_ = 0.0;
  CallistoModulation<double> callisto_;
};

/// A surface of such facets as an integrator.
class MicrofacetDiffuseSurface : public Integrator {
 public:
  /// Throws Error(usage) for parameters that do not go together.
  explicit MicrofacetDiffuseSurface(std::span<const double> flat);
  ~MicrofacetDiffuseSurface() override;

  int channels() const override { return grey_ ? 1 : 3; }
  /// Interfaced facets have none to keep apart: their albedo is not a power of ρ.
  int orders() const override;
  bool has_exact() const override;
  /// By quadrature (relative error estimate below 1e-11, of anisotropic and other than Lambertian facets 1e-8); all
  /// bounces of Lambertian isotropic facets by SmithOrders, to 1e-9 of f up to 85 degrees and some 1e-8 beyond.
  void exact_row(const Direction& wo, std::span<const Direction> wi, const Line& line) const override;
  void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points, std::uint32_t samples,
                  bool fast, const Line& line) const override;

  static constexpr int unlimited = 1 << 20;  // bounces
  static constexpr int kept_orders = 24;     // of unlimited ones
  static constexpr int most_orders = 64;     // told apart inside

 private:
  using OrderSums = std::vector<double>;  // [order][light]

  /// The direction whose visible normals are sampled: wo, or the normal for area_mean.
  Direction seen_from(const Direction& wo) const;
  /// G2/G1: order 1 of f per unit of albedo = weight × E[(wi·m)⁺ body] / (π μi) over those normals.
  double weight(const Direction& wi, const Direction& wo) const;
  double exact_first_order(const Direction& wi, const Direction& wo) const;
  const SmithOrders& smith_orders() const;
  Direction to_surface(const Direction& w) const;
  /// Values and kept orders from sums over orders 1, 2, …, per unit of albedo to their power.
  void finish(const OrderSums& sums, std::size_t lights, const Line& line) const;
  void sample_paths(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points,
                    std::uint32_t samples, OrderSums& sums) const;

  Distribution distribution_;
  Masking masking_;
  Alpha alpha_;
  double cos_orientation_, sin_orientation_;
  int bounces_;
  DiffuseFacet facet_;
  Rgb albedo_;
  bool grey_;
  mutable std::once_flag solved_;
  mutable std::unique_ptr<SmithOrders> smith_orders_;
};

}  // namespace lobefit
