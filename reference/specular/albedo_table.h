// Directional albedos E(μ, α) of a rough interface: what a renderer's energy compensation is built from (Kulla, Conty
// 2017; Turquin 2019; Fdez-Agüera 2019). Isotropic facets only.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "reference/json_reader.h"
#include "reference/monitor.h"
#include "reference/specular/rough_interface.h"

namespace lobefit {

/// `error`: the quadrature's own estimate, or a standard error.
struct AlbedoValue {
  double value = 0.0, error = 0.0;
};

/// What one bounce sends back into the half space it comes from: ∫ F(cos θ_d) G2/G1 over the visible normals of a
/// direction at `cosine` in (0, 1] whose reflection leaves. Error estimate below 1e-8 for a reflectance without kinks;
/// `critical_cosine` is where it has one (0: nowhere). Facets isotropic and rough.
AlbedoValue reflected_albedo(const Facets& facets, InterfaceMasking masking, double cosine,
                             const std::function<double(double cosine_d)>& reflectance, double critical_cosine = 0.0);
/// What one bounce sends across, by dielectric facets; `eta`: index on the other side over the index on the light's.
AlbedoValue transmitted_albedo(const Facets& facets, InterfaceMasking masking, double cosine, double eta);
/// 2 ∫ E(μ) μ dμ; `critical_cosine` as above.
AlbedoValue average_albedo(const std::function<AlbedoValue(double cosine)>& albedo, double critical_cosine = 0.0);

struct AlbedoTableOptions {
  Distribution distribution = Distribution::ggx;
  InterfaceMasking masking = InterfaceMasking::correlated;
  FacetReflectance reflectance = FacetReflectance::schlick({1.0, 1.0, 1.0}, {1.0, 1.0, 1.0});
  int bounces = 1;
  std::vector<double> mu, alpha;
  std::uint64_t samples = 1u << 16;  // per entry, of all replicates together; several bounces only
  std::uint64_t seed = 1;
};

/// One quantity over the grid.
struct AlbedoColumn {
  std::string name, doc;
  std::vector<double> value, error;            // [alpha][mu]
  std::vector<double> average, average_error;  // [alpha]: 2 ∫ E μ dμ
};

struct AlbedoTable {
  AlbedoTableOptions options;
  std::vector<AlbedoColumn> columns;

  /// Throws std::out_of_range.
  const AlbedoColumn& column(std::string_view name) const;
  /// The table with units and provenance. `parameters` and `command` as the caller knows them.
  Json json(const Json& parameters, const std::string& command) const;
};

/// One bounce, by quadrature: Schlick facets give E for F = 1 (`albedo`) and its split, so that
/// E_F = f0 `f0_weight` + f90 `f90_weight`; conductors give `reflected`; dielectrics give `reflected_above`,
/// `transmitted_above` and the same from below, the energy's shares.
/// Several bounces, by quadrature for the first and walks for the others: `reflected`, or the four shares.
/// The bits do not depend on the number of threads. Throws Error(usage) for cosines outside (0, 1], for alphas outside
/// [1e-4, 1] and for reflectances that differ between channels.
AlbedoTable make_albedo_table(const AlbedoTableOptions& options, Monitor& monitor);

}  // namespace lobefit
