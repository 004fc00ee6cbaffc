// The specular BRDFs and the sampling of facets.

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "evaluate/float_model.h"
#include "models/microfacet/sampling.h"
#include "models/specular/ggx.h"
#include "models/specular/karis.h"
#include "reference/specular/albedo_table.h"
#include "reference/visible_normals.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/model_values.h"
#include "tests/sphere_sampling.h"

namespace lobefit {
namespace {

// ---- specular_ggx -----------------------------------------------------------------------------------------------

TEST(SpecularGgx, Values) {
  // 60°, 60°, φ = 180°, α = ½: D = 1/(π ¼) = 4/π, V = ½/(2 ½ √7/4) = 2/√7, F = .04 + .96/32 = .07: .56/(π√7)
  const Direction wi = direction(radians(60.0), 0.2), mirror = direction(radians(60.0), 0.2 + pi);
  EXPECT_NEAR(value("specular_ggx", {{"alpha", 0.5}}, wi, mirror), 0.0673735038956467824, 1e-14);
  // φ = 0: h at 60°, D = 64/(169π), F = f0, V as before: .04 × 128/(169π√7)
  EXPECT_NEAR(value("specular_ggx", {{"alpha", 0.5}}, wi, wi), 0.04 * 0.0911222368833768823, 1e-14);
}

TEST(SpecularGgx, IsTheProductOfItsTerms) {
  for (const double alpha : {0.002, 0.05, 0.3, 1.0}) {
    for (const auto& [wi, wo] : random_pairs(500, 71)) {
      const double product = value("d_ggx", {{"alpha", alpha}}, wi, wo) *
                             value("g_smith_ggx_correlated", {{"alpha", alpha}}, wi, wo) *
                             value("f_schlick", {{"f0", 0.1}, {"f90", 0.8}}, wi, wo) / (4.0 * wi.z * wo.z);
      const Parameters lobe{{"f0", 0.1}, {"f90", 0.8}, {"alpha", alpha}, {"anisotropy", 0.0}};
      EXPECT_NEAR(value("specular_ggx", lobe, wi, wo), product, 1e-11 * product) << alpha;
      const Geometry<double> g = make_geometry(wi, wo);
      EXPECT_NEAR(ggx_lobe(alpha, g) * SchlickFresnel::evaluate(g.cos_theta_d, 0.1, 0.8), product, 1e-11 * product);
    }
  }
}

TEST(SpecularGgx, NegativeAnisotropyTurnsIt) {
  for (const auto& [wi, wo] : random_pairs(200, 72)) {
    const auto turned = [](const Direction& w) { return Direction{-w.y, w.x, w.z}; };
    const double here = value("specular_ggx", {{"alpha", 0.3}, {"anisotropy", 0.6}}, wi, wo);
    EXPECT_NEAR(value("specular_ggx", {{"alpha", 0.3}, {"anisotropy", -0.6}}, turned(wi), turned(wo)), here,
                1e-12 * here);
  }
}

TEST(SpecularGgx, LobesMayBeAskedForMirrors) {
  const Geometry<double> g = make_geometry(direction(0.4, 0.0), direction(0.4, pi));
  EXPECT_EQ(ggx_lobe(0.0, g), ggx_lobe(smallest_alpha, g));
  EXPECT_TRUE(std::isfinite(ggx_lobe(AlphaPair<double>{0.0, 0.5}, g)));
}

/// E(μ) at F = 1 by the model's own sampling on a midpoint grid of its numbers. Sharp lobes lose energy in their tails
/// alone, at u = 1: u = 1 - t³ puts points there.
double specular_ggx_albedo(std::span<const double> flat, double cosine, int steps) {
  const Model& model = find_model("specular_ggx");
  const Direction wo{std::sqrt((1.0 - cosine) * (1.0 + cosine)), 0.0, cosine};
  double sum = 0.0;
  for (int i = 0; i < steps * steps; ++i) {
    const double t = (i / steps + 0.5) / steps;
    const Direction wi = model.sample(flat, wo, {1.0 - t * t * t, (i % steps + 0.5) / steps});
    if (wi.z > 0.0) sum += 3.0 * t * t * model.evaluate(flat, wi, wo).x * wi.z / model.pdf(flat, wi, wo);
  }
  return sum / (steps * steps);
}

TEST(SpecularGgx, WhiteFurnaceIsThatOfTheAlbedoTable) {
  // Two independent integrals: the table's over slopes, and this model's samples.
  double worst = 0.0;
  for (const double alpha : {0.01, 0.1, 0.3, 0.6, 1.0}) {
    const std::vector<double> flat = flat_of("specular_ggx", {{"f0", 1.0}, {"f90", 1.0}, {"alpha", alpha}});
    for (const double cosine : {1.0, 0.7, 0.3, 0.1}) {
      const AlbedoValue table = reflected_albedo({.alpha_x = alpha, .alpha_y = alpha}, InterfaceMasking::correlated,
                                                 cosine, [](double) { return 1.0; });
      const double found = specular_ggx_albedo(flat, cosine, 300);
      worst = std::max(worst, std::abs(found - table.value));
      EXPECT_NEAR(found, table.value, 3e-5) << "alpha " << alpha << ", cosine " << cosine;
      std::printf("E(mu %.1f, alpha %-4g) = %.6f, sampled %.6f\n", cosine, alpha, table.value, found);
    }
  }
  RecordProperty("worst_difference", number_text(worst));
}

TEST(SpecularGgx, AlbedoAtTheRoughestNormalIsItsClosedForm) {
  // α = 1: D = 1/π, Λ = ½(1/μ - 1). View at the normal: f = D/(4μ) G, G = 1/(1 + Λ) = 2μ/(1 + μ), so
  // E = 2π ∫ μ/(2π(1 + μ)) dμ = 1 - ln 2.
  const std::vector<double> flat = flat_of("specular_ggx", {{"f0", 1.0}, {"f90", 1.0}, {"alpha", 1.0}});
  const Model& model = find_model("specular_ggx");
  double albedo = 0.0;
  for (const auto& [mu, weight] : gauss_legendre(32, 0.0, 1.0)) {
    albedo += 2.0 * pi * weight * mu * model.evaluate(flat, direction(std::acos(mu), 1.0), {0.0, 0.0, 1.0}).x;
  }
  EXPECT_NEAR(albedo, 1.0 - std::numbers::ln2, 1e-12);
}

// ---- specular_karis ---------------------------------------------------------------------------------------------

TEST(SpecularKaris, IsAnyProductOfTheTerms) {
  const std::vector<DirectionPair> pairs = random_pairs(64, 73);
  FloatPairs float_pairs(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
  FloatRgb float_values(pairs.size());
  const FloatModel& float_model = find_float_model("specular_karis");
  constexpr double alpha = 0.375, f0 = 0.25;
  int combinations = 0;
  for (const std::string_view d : SpecularKaris::distribution_choices) {
    for (const std::string_view g : SpecularKaris::masking_choices) {
      for (const std::string_view f : SpecularKaris::fresnel_choices) {
        ParameterValues values = find_model("specular_karis").defaults();
        values.set("alpha", alpha);
        values.set("f0", f0);
        values.set("anisotropy", 0.5);
        values.set_text("distribution", d);
        values.set_text("masking", g);
        values.set_text("fresnel", f);
        const std::vector<float> float_flat(values.flat().begin(), values.flat().end());
        float_model.evaluate(float_flat, float_pairs, 0, pairs.size(), float_values);
        for (std::size_t i = 0; i < pairs.size(); ++i) {
          const Direction wi = float_pairs.wi(i), wo = float_pairs.wo(i);
          const auto term = [&](const std::string& name, const char* parameter, double set_to) {
            const Model& model = find_model(name);
            return model.parameters.empty() ? value(name, {}, wi, wo) : value(name, {{parameter, set_to}}, wi, wo);
          };
          const double aspect = std::sqrt(1.0 - 0.9 * 0.5);
          const double density =
              d == "ggx_anisotropic"
                  ? value("d_ggx_anisotropic", {{"alpha_x", alpha / aspect}, {"alpha_y", alpha * aspect}}, wi, wo)
                  : term("d_" + std::string(d), "alpha", alpha);
          const double product = density * term("g_" + std::string(g), "alpha", alpha) *
                                 term("f_" + std::string(f), "f0", f0) / (4.0 * wi.z * wo.z);
          const double found = find_model("specular_karis").evaluate(values.flat(), wi, wo).y;
          EXPECT_NEAR(found, product, 1e-13 + 1e-11 * product) << d << " " << g << " " << f;
          EXPECT_NEAR(float_values.g[i], product, 1e-5 * product + 1e-6) << "in float " << d << " " << g << " " << f;
        }
        ++combinations;
      }
    }
  }
  EXPECT_EQ(combinations, SpecularKaris::variant_count);
}

TEST(SpecularKaris, EnergyOfEachPairing) {
  // F = 1 at α = ½: which D × G gain energy. By half vectors of GGX facets with α = ½, on a midpoint grid.
  constexpr int steps = 128;
  const Model& model = find_model("specular_karis");
  double largest = 0.0;
  for (const std::string_view d : SpecularKaris::distribution_choices) {
    for (const std::string_view g : SpecularKaris::masking_choices) {
      ParameterValues values = model.defaults();
      values.set("f0", 1.0);
      values.set("alpha", 0.5);
      values.set("anisotropy", 0.0);
      values.set_text("distribution", d);
      values.set_text("masking", g);
      values.set_text("fresnel", "none");
      double worst = 0.0;
      for (const double cosine : {1.0, 0.7, 0.4, 0.2, 0.1, 0.05}) {
        const Direction wo{std::sqrt((1.0 - cosine) * (1.0 + cosine)), 0.0, cosine};
        double sum = 0.0;
        for (int i = 0; i < steps * steps; ++i) {
          const std::array<double, 2> u{(i / steps + 0.5) / steps, (i % steps + 0.5) / steps};
          const Direction wi = reflect(wo, sample_facet(Distribution::ggx, 0.5, u));
          const double density = reflected_density(
              wi, wo, [](const Direction& m) { return facet_sampling_density(Distribution::ggx, 0.5, m); });
          if (wi.z > 0.0 && density > 0.0) sum += model.evaluate(values.flat(), wi, wo).x * wi.z / density;
        }
        worst = std::max(worst, sum / (steps * steps));
      }
      std::printf("%-16s %-17s largest albedo %.3f\n", std::string(d).c_str(), std::string(g).c_str(), worst);
      largest = std::max(largest, worst);
      // Smith's functions of the distribution's own: never more than comes in.
      const bool own_smith = (d == "ggx" && g == "smith_ggx") || (d == "beckmann" && g == "smith_beckmann");
      EXPECT_LT(worst, own_smith ? 1.001 : 100.0);
    }
  }
  EXPECT_GT(largest, 1.01) << "the model says that it can gain";
}

/// specular_karis with a distribution and a masking term by their numbers, F = 1.
std::vector<double> karis_mirrors(std::size_t d, std::size_t g, double alpha, double anisotropy) {
  ParameterValues values = find_model("specular_karis").defaults();
  for (const char* name : {"f0", "alpha", "anisotropy"}) {
    values.set(name, name == std::string("f0") ? 1.0 : name == std::string("alpha") ? alpha : anisotropy);
  }
  values.set_text("fresnel", "none");
  values.set_text("distribution", std::string(SpecularKaris::distribution_choices[d]));
  values.set_text("masking", std::string(SpecularKaris::masking_choices[g]));
  return {values.flat().begin(), values.flat().end()};
}
constexpr std::size_t karis_distributions = SpecularKaris::distribution_choices.size();
constexpr std::size_t karis_maskings = SpecularKaris::masking_choices.size();

TEST(SpecularKaris, SamplesFollowTheirDensity) {
  // Every distribution, under a term whose samples are of visible facets alone and one where they are not.
  const Model& model = find_model("specular_karis");
  for (std::size_t d = 0; d < karis_distributions; ++d) {
    for (const std::size_t g : {5, 3}) {
      const std::vector<double> flat = karis_mirrors(d, g, 0.5, 0.5);
      for (const double theta : {0.0, 50.0, 80.0}) {
        const SamplingFit fit = expect_samples_follow_pdf(model, flat, direction(radians(theta), 0.4));
        std::printf("%s, %s, %g degrees: chi2 %.0f of %d cells\n", SpecularKaris::distribution_choices[d].data(),
                    SpecularKaris::masking_choices[g].data(), theta, fit.chi2, fit.cells);
      }
    }
  }
}

TEST(SpecularKaris, SamplesIntegrateToTheAlbedo) {
  // Against quadrature that knows nothing of the sampling; its cut where a facet's half sphere ends costs it 1e-3.
  const Model& model = find_model("specular_karis");
  double worst = 0.0;
  for (std::size_t d = 0; d < karis_distributions; ++d) {
    for (std::size_t g = 0; g < karis_maskings; ++g) {
      const std::vector<double> flat = karis_mirrors(d, g, 0.5, 0.5);
      const Direction wo = direction(radians(60.0), 0.4);
      const double sampled = sampled_albedo(model, flat, wo, 300), integral = integrated_albedo(model, flat, wo);
      worst = std::max(worst, std::abs(sampled - integral));
      EXPECT_NEAR(sampled, integral, 2e-3) << "D " << d << ", G " << g;
    }
  }
  std::printf("samples against quadrature: %.2g\n", worst);
}

TEST(SpecularKaris, WeightsOfItsSamplesAreBounded) {
  const Model& model = find_model("specular_karis");
  double largest = 0.0;
  UniformNumbers uniform(77);
  for (std::size_t d = 0; d < karis_distributions; ++d) {
    for (std::size_t g = 0; g < karis_maskings; ++g) {
      for (const double alpha : {0.001, 0.03, 0.1, 0.5, 1.0}) {
        for (const double cosine_o : {1.0, 0.5, 0.1, 0.01, 0.001}) {
          const std::vector<double> flat = karis_mirrors(d, g, alpha, uniform());
          const Direction wo = direction(std::acos(cosine_o), 2.0 * pi * uniform());
          for (int i = 0; i < 2000; ++i) {
            const double u0 = uniform(), u1 = uniform();
            const Direction wi = model.sample(flat, wo, {u0, u1});
            if (wi.z <= 0.0) continue;
            const double weight = model.evaluate(flat, wi, wo).x * wi.z / model.pdf(flat, wi, wo);
            ASSERT_TRUE(std::isfinite(weight));
            largest = std::max(largest, weight);
          }
        }
      }
    }
  }
  std::printf("largest f cos/pdf: %.3g\n", largest);
  // Beckmann's masking of anisotropic GGX facets: 1/(G1 of GGX).
  EXPECT_LT(largest, 8.0);
}

// ---- float ------------------------------------------------------------------------------------------------------

/// Pairs whose half vectors are within a few alphas of the normal: where sharp lobes live.
std::vector<DirectionPair> pairs_in_the_lobe(double alpha, std::size_t count) {
  UniformNumbers uniform(74);
  std::vector<DirectionPair> pairs;
  while (pairs.size() < count) {
    const double cosine = uniform.between(0.02, 1.0), azimuth = 2.0 * pi * uniform();
    const Direction wo = direction(std::acos(cosine), azimuth);
    const double slope = 6.0 * alpha * uniform(), turn = 2.0 * pi * uniform();
    const Direction wi = reflect(wo, normalize(Direction{slope * std::cos(turn), slope * std::sin(turn), 1.0}));
    if (wi.z > 1e-3) pairs.push_back({wi, wo});
  }
  return pairs;
}

TEST(Float, HoldsInsideSharpLobes) {
  // 1e-5 relative plus 1e-6 absolute, no allowance for conditioning. Both sides see the same rounded inputs.
  struct Case {
    std::string_view model;
    std::string_view first, second;
  };
  const Case cases[] = {{"d_blinn_phong", "alpha", ""},
                        {"d_beckmann", "alpha", ""},
                        {"d_ggx", "alpha", ""},
                        {"d_gtr1", "alpha", ""},
                        {"d_charlie", "alpha", ""},
                        {"d_ashikhmin", "alpha", ""},
                        {"d_ashikhmin_approx", "alpha", ""},
                        {"d_beckmann_anisotropic", "alpha_x", "alpha_y"},
                        {"d_ggx_anisotropic", "alpha_x", "alpha_y"},
                        {"specular_ggx", "alpha", ""},
                        {"specular_karis", "alpha", ""}};
  for (const Case& c : cases) {
    for (const double alpha : {0.002, 0.005, 0.02, 0.1, 0.5}) {
      ParameterValues values = find_model(c.model).defaults();
      values.set(c.first, static_cast<float>(alpha));
      if (!c.second.empty()) values.set(c.second, static_cast<float>(0.7 * alpha));
      const std::vector<float> float_flat(values.flat().begin(), values.flat().end());
      const std::vector<double> flat(float_flat.begin(), float_flat.end());
      const std::vector<DirectionPair> pairs = pairs_in_the_lobe(alpha, 4096);
      FloatPairs float_pairs(pairs.size());
      for (std::size_t i = 0; i < pairs.size(); ++i) float_pairs.set(i, pairs[i].wi, pairs[i].wo);
      FloatRgb found(pairs.size());
      find_float_model(c.model).evaluate(float_flat, float_pairs, 0, pairs.size(), found);
      double worst = 0.0, relative = 0.0;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        const double truth = find_model(c.model).evaluate(flat, float_pairs.wi(i), float_pairs.wo(i)).x;
        const double error = std::abs(found.r[i] - truth);
        worst = std::max(worst, error / (1e-5 * truth + 1e-6));
        if (truth > 1e-3) relative = std::max(relative, error / truth);
      }
      EXPECT_LE(worst, 1.0) << c.model << " at alpha " << alpha;
      std::printf("%-24s alpha %-6g largest relative error %.2g\n", std::string(c.model).c_str(), alpha, relative);
    }
  }
}

TEST(Float, TextbookGgxWouldNotHold) {
  double worst = 0.0;
  for (const auto& [wi, wo] : pairs_in_the_lobe(0.002, 4096)) {
    FloatPairs rounded(1);
    rounded.set(0, wi, wo);
    const auto single = [](const Direction& w) { return Vec3<Single>{Single(w.x), Single(w.y), Single(w.z)}; };
    const double truth = GgxDistribution::evaluate(make_geometry(rounded.wi(0), rounded.wo(0)).sin2_theta_h,
                                                   static_cast<double>(0.002f));
    const float c = make_geometry(single(wi), single(wo)).cos_theta_h.value;
    const float a2 = 0.002f * 0.002f, d = (c * a2 - c) * c + 1.0f;
    worst = std::max(worst, std::abs(static_cast<double>(a2 / (static_cast<float>(pi) * d * d)) / truth - 1.0));
  }
  EXPECT_GT(worst, 0.05);
  std::printf("textbook GGX in float at alpha .002: off by %.3g\n", worst);
}

// ---- sampling ---------------------------------------------------------------------------------------------------

TEST(Sampling, InverseErf) {
  for (const double y : {-0.999999, -0.9, -0.1, -1e-9, 0.0, 1e-12, 0.3, 0.5, 0.99, 1.0 - 1e-9}) {
    EXPECT_NEAR(std::erf(inverse_erf(y)), y, 2e-16) << y;
  }
  EXPECT_NEAR(inverse_erf(0.5), 0.476936276204469873, 1e-15);
  EXPECT_TRUE(std::isfinite(inverse_erf(-1.0)));
  EXPECT_TRUE(std::isfinite(inverse_erf(1.0)));
}

/// A way to sample facets, as the tests see it.
struct FacetSampling {
  const char* name;
  Distribution distribution;
  Alpha alpha;
  bool visible;
  Direction wo;

  Direction sample(const std::array<double, 2>& u) const {
    return visible ? sample_visible_facet(distribution, alpha, wo, u) : sample_facet(distribution, alpha, u);
  }
  double density(const Direction& m) const {
    return visible ? visible_facet_density(distribution, alpha, wo, m) : facet_sampling_density(distribution, alpha, m);
  }
  /// A facet by its slopes in units of alpha: m ∝ (αx r cos φ, αy r sin φ, 1), r = √(v/(1 - v)).
  Direction facet(double v, double phi) const {
    const double r = std::sqrt(v / (1.0 - v));
    return normalize(Direction{alpha.x * r * std::cos(phi), alpha.y * r * std::sin(phi), 1.0});
  }
  /// dω = cos³θ αx αy r dr dφ, r dr = ½ dv/(1 - v)²
  double solid_angle(double v, double phi) const {
    return std::pow(facet(v, phi).z, 3.0) * alpha.x * alpha.y * 0.5 / ((1.0 - v) * (1.0 - v));
  }
};

std::vector<FacetSampling> samplings() {
  std::vector<FacetSampling> list;
  for (const Distribution distribution : {Distribution::ggx, Distribution::beckmann}) {
    for (const Alpha alpha : {Alpha(0.02), Alpha(0.3), Alpha(1.0), Alpha(0.05, 0.5), Alpha(0.8, 0.2)}) {
      const char* name = distribution == Distribution::ggx ? "GGX" : "Beckmann";
      list.push_back({name, distribution, alpha, false, direction(0.5, 0.0)});
      for (const double theta : {0.0, 40.0, 70.0, 86.0}) {
        list.push_back({name, distribution, alpha, true, direction(radians(theta), 0.9)});
      }
    }
  }
  return list;
}

std::string text(const FacetSampling& s) {
  return std::string(s.name) +
         (s.visible ? " visible, view at " + number_text(degrees(std::acos(s.wo.z))) : " facets") + ", alpha " +
         number_text(s.alpha.x) + " " + number_text(s.alpha.y);
}

constexpr int rings = 12, sectors = 16;

/// ∫ density dω over one cell of the (v, φ) grid. GGX has as many facets in each ring; the tail of v is an integrable
/// power, hence panels that shrink towards its end.
double expected_share(const FacetSampling& s, int ring, int sector) {
  constexpr int points = 8, halvings = 12;
  const double v0 = static_cast<double>(ring) / rings, v1 = (ring + 1.0) / rings;
  const double phi0 = 2.0 * pi * sector / sectors, phi1 = 2.0 * pi * (sector + 1) / sectors;
  double sum = 0.0;
  const int panels = ring == rings - 1 ? halvings : 2;
  for (int panel = 0; panel < panels; ++panel) {
    const double right = v1 - (panel + 1 < panels ? std::ldexp(v1 - v0, -panel - 1) : 0.0);
    for (const auto& [v, wv] : gauss_legendre(points, v1 - std::ldexp(v1 - v0, -panel), right)) {
      for (int part = 0; part < 4; ++part) {
        const double from = phi0 + (phi1 - phi0) * part / 4.0, to = phi0 + (phi1 - phi0) * (part + 1) / 4.0;
        for (const auto& [phi, wphi] : gauss_legendre(points, from, to)) {
          sum += wv * wphi * s.density(s.facet(v, phi)) * s.solid_angle(v, phi);
        }
      }
    }
  }
  return sum;
}

TEST(Sampling, DensitiesAreThoseOfTheSamples) {
  // Pearson's χ² over 12 × 16 cells of equal probability for GGX facets. With 191 degrees of freedom χ² has mean 191
  // and deviation 19.5; 60 tests at five deviations (one-sided 1e-6 or so, χ² being skewed) almost never fail by
  // chance. Cells that expect fewer than 8 samples are pooled.
  constexpr int count = 100'000;
  for (const FacetSampling& s : samplings()) {
    UniformNumbers uniform(75);
    std::vector<int> hits(rings * sectors);
    for (int i = 0; i < count; ++i) {
      const double u0 = uniform(), u1 = uniform();
      const Direction m = s.sample({u0, u1});
      const double x = m.x / (s.alpha.x * m.z), y = m.y / (s.alpha.y * m.z), r2 = x * x + y * y;
      const double turn = std::atan2(y, x) / (2.0 * pi);
      const int ring = m.z > 0.0 ? std::min(rings - 1, static_cast<int>(rings * (r2 / (1.0 + r2)))) : rings - 1;
      const int sector = std::min(sectors - 1, static_cast<int>(sectors * (turn < 0.0 ? turn + 1.0 : turn)));
      ++hits[static_cast<std::size_t>(ring * sectors + sector)];
    }
    double total = 0.0, chi2 = 0.0, pooled_expected = 0.0, pooled_hits = 0.0;
    int cells = 0;
    for (int ring = 0; ring < rings; ++ring) {
      for (int sector = 0; sector < sectors; ++sector) {
        const double share = expected_share(s, ring, sector), expected = share * count;
        const double found = hits[static_cast<std::size_t>(ring * sectors + sector)];
        total += share;
        if (expected < 8.0) {
          pooled_expected += expected, pooled_hits += found;
        } else {
          chi2 += (found - expected) * (found - expected) / expected;
          ++cells;
        }
      }
    }
    if (pooled_expected > 8.0) {
      chi2 += (pooled_hits - pooled_expected) * (pooled_hits - pooled_expected) / pooled_expected, ++cells;
    } else {
      EXPECT_LT(pooled_hits, 40.0) << text(s);
    }
    // The kink of the view's horizon cuts through cells; the quadrature knows nothing of it.
    EXPECT_NEAR(total, 1.0, s.visible ? 2e-3 : 1e-7) << text(s);
    EXPECT_LT(chi2, cells + 5.0 * std::sqrt(2.0 * cells)) << text(s);
  }
}

TEST(Sampling, DensityOfReflectedDirectionsIsNormalised) {
  // Over the whole sphere of wi: facets that face away from wo reflect nothing, and only visible ones never do.
  for (const FacetSampling& s : samplings()) {
    if (s.alpha.x < 0.1 || s.alpha.y < 0.1) continue;
    double sphere = 0.0;
    const int n = 400;
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < 2 * n; ++k) {
        const double z = 2.0 * (i + 0.5) / n - 1.0, phi = pi * (k + 0.5) / n, r = std::sqrt(1.0 - z * z);
        sphere += reflected_density({r * std::cos(phi), r * std::sin(phi), z}, s.wo,
                                    [&](const Direction& m) { return s.density(m); });
      }
    }
    sphere *= 4.0 * pi / (2.0 * n * n);
    EXPECT_LE(sphere, 1.0 + 5e-3) << text(s);
    EXPECT_GE(sphere, s.visible ? 1.0 - 5e-3 : 0.5) << text(s);
  }
}

TEST(Sampling, VisibleFacetsAreTheReferences) {
  // The same maps, written twice: the integrators' vectorised one and this.
  for (const FacetSampling& s : samplings()) {
    if (!s.visible || s.wo.z == 1.0) continue;
    UniformNumbers uniform(76);
    for (int i = 0; i < 100; ++i) {
      const std::array<double, 2> u{uniform(), uniform()};
      const Direction here = s.sample(u), there = sample_visible_normal(s.distribution, s.alpha, s.wo, u);
      EXPECT_NEAR(here.x, there.x, 1e-9) << text(s);
      EXPECT_NEAR(here.y, there.y, 1e-9) << text(s);
      EXPECT_NEAR(here.z, there.z, 1e-9) << text(s);
    }
  }
}

}  // namespace
}  // namespace lobefit
