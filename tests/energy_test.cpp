// Tables in texts, the directional albedo of GGX, energy compensation, and haze.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "evaluate/single.h"
#include "fit/dual.h"
#include "fit/forms.h"
#include "models/energy/compensated_ggx.h"
#include "models/registry.h"
#include "models/specular/haze.h"
#include "reference/specular/albedo_table.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/model_values.h"

namespace lobefit {
namespace {

/// The integrals that the shipped tables were made of.
double albedo(double cosine, double alpha) {
  return reflected_albedo({.alpha_x = alpha, .alpha_y = alpha}, InterfaceMasking::correlated, cosine,
                          [](double) { return 1.0; })
      .value;
}
double grazing_albedo(double cosine, double alpha) {
  return reflected_albedo({.alpha_x = alpha, .alpha_y = alpha}, InterfaceMasking::correlated, cosine,
                          [](double c) { return std::pow(1.0 - c, 5.0); })
      .value;
}

// ---- tables in texts --------------------------------------------------------------------------------------------

constexpr double quadratic(double u, double v) { return (1.0 - u * u) * (2.0 + v - v * v) + 0.5 * u; }

/// Its samples, with the border outside [0, 1].
struct QuadraticTable {
  static constexpr const char* name = "quadratic_table";
  static constexpr int columns = 5, rows = 4;
  static constexpr auto entries = [] {
    std::array<float, (columns + 2) * (rows + 2)> result{};
    for (int row = 0; row < rows + 2; ++row) {
      for (int column = 0; column < columns + 2; ++column) {
        result[static_cast<std::size_t>(row * (columns + 2) + column)] =
            static_cast<float>(quadratic((column - 1.0) / (columns - 1.0), (row - 1.0) / (rows - 1.0)));
      }
    }
    return result;
  }();
};

TEST(Lookup, ReproducesQuadraticsUpToTheBorder) {
  // Catmull-Rom splines reproduce polynomials of second degree; what is left is the entries' rounding to float.
  for (const auto& [first, second] : random_pairs(200, 21)) {
    const double u = first.z, v = second.z;
    EXPECT_NEAR(lookup<QuadraticTable>(u, v), quadratic(u, v), 5e-7) << u << " " << v;
  }
  EXPECT_NEAR(lookup<QuadraticTable>(0.0, 0.0), 2.0, 1e-7);
  EXPECT_NEAR(lookup<QuadraticTable>(1.0, 1.0), 0.5, 1e-7);
  EXPECT_EQ(lookup<QuadraticTable>(1.5, -3.0), lookup<QuadraticTable>(1.0, 0.0));
}

TEST(Lookup, DerivativesAreThoseOfTheSpline) {
  for (const auto& [first, second] : random_pairs(200, 22)) {
    const double u = first.z, v = second.z;
    const auto dual = lookup<QuadraticTable>(Dual<2>::variable(u, 0), Dual<2>::variable(v, 1));
    EXPECT_NEAR(dual.derivative[0], -2.0 * u * (2.0 + v - v * v) + 0.5, 1e-5);
    EXPECT_NEAR(dual.derivative[1], (1.0 - u * u) * (1.0 - 2.0 * v), 1e-5);
  }
}

TEST(Lookup, FloatReadsTheSameTable) {
  for (const auto& [first, second] : random_pairs(2000, 23)) {
    const Single u(first.z), v(second.z);
    EXPECT_NEAR(lookup<GgxAlbedoLossTable>(u, v).value, lookup<GgxAlbedoLossTable>(double{u.value}, double{v.value}),
                2e-6);
  }
}

// ---- albedos ----------------------------------------------------------------------------------------------------

TEST(GgxAlbedo, EntriesAreTheIntegralAgain) {
  // Every seventh entry of the loss and of the Schlick weight, off the borders.
  const auto inner = [](int columns, int row, int column) {
    return static_cast<std::size_t>((row + 1) * (columns + 2) + column + 1);
  };
  for (int k = 0; k < ggx_loss_rows * ggx_loss_columns; k += 7) {
    const int row = k / ggx_loss_columns, column = k % ggx_loss_columns;
    const double v = row / (ggx_loss_rows - 1.0), u = column / (ggx_loss_columns - 1.0);
    const double alpha = std::max(v * v, 1e-4), c = 3.0 * alpha, t = u * u;
    const double mu = std::min(c * t / (1.0 + c - t), 1.0);
    const double loss = mu > 0.0 ? (1.0 - albedo(mu, alpha)) * std::pow((mu + c) / c, 2.0) : 0.0;
    EXPECT_NEAR(ggx_loss_entries[inner(ggx_loss_columns, row, column)], loss, 2e-7 * std::pow((mu + c) / c, 2.0) + 1e-7)
        << u << " " << v;
  }
  for (int k = 0; k < ggx_weight_rows * ggx_weight_columns; k += 7) {
    const int row = k / ggx_weight_columns, column = k % ggx_weight_columns;
    const double v = row / (ggx_weight_rows - 1.0), u = column / (ggx_weight_columns - 1.0);
    const double alpha = std::max(v * v, 1e-4), mu = std::max(u * u, 1e-12);
    EXPECT_NEAR(ggx_weight_entries[inner(ggx_weight_columns, row, column)],
                grazing_albedo(mu, alpha) / albedo(mu, alpha), 1e-6)
        << u << " " << v;
  }
}

struct Error {
  double worst = 0.0, square = 0.0;
  int count = 0;
  void add(double difference) {
    worst = std::max(worst, std::abs(difference));
    square += difference * difference;
    ++count;
  }
  double rms() const { return std::sqrt(square / count); }
};

TEST(GgxAlbedo, ErrorsOfTheTableAndOfThePublishedFits) {
  Error table, weight, material_x, material_x_f0, karis, karis_f0;
  const auto form = [](const char* name, double mu, double alpha) {
    const Form& found = find_form(name);
    return found.evaluate(found.published(), std::vector{mu, alpha}, nullptr);
  };
  for (int i = 0; i < 32; ++i) {
    for (int k = 0; k < 32; ++k) {
      const double x = (i + 0.43) / 32.0, y = (k + 0.57) / 32.0, mu = x * x, alpha = std::max(y * y, 1e-3);
      const double truth = albedo(mu, alpha), grazing = grazing_albedo(mu, alpha);
      table.add(1.0 - GgxAlbedoLoss::evaluate(mu, alpha) - truth);
      weight.add(GgxSchlickWeight::evaluate(mu, alpha) - grazing / truth);
      const double material_x_scale = form("materialx_scale", mu, alpha);
      const double material_x_bias = form("materialx_bias", mu, alpha);
      const double karis_scale = form("karis_scale", mu, alpha), karis_bias = form("karis_bias", mu, alpha);
      material_x.add(material_x_scale + material_x_bias - truth);
      karis.add(karis_scale + karis_bias - truth);
      // A dielectric: f0 = .04, f90 = 1.
      const double dielectric = 0.04 * (truth - grazing) + grazing;
      material_x_f0.add(0.04 * material_x_scale + material_x_bias - dielectric);
      karis_f0.add(0.04 * karis_scale + karis_bias - dielectric);
    }
  }
  const auto report = [](const char* name, const Error& error) {
    std::printf("%-32s worst %.1e, rms %.1e\n", name, error.worst, error.rms());
  };
  report("E by the table", table);
  report("Schlick weight by the table", weight);
  report("E by MaterialX's fit", material_x);
  report("E by Karis's fit", karis);
  report("E_F, f0 = .04, MaterialX", material_x_f0);
  report("E_F, f0 = .04, Karis", karis_f0);
  EXPECT_LT(table.worst, 4.5e-4);
  EXPECT_LT(table.rms(), 1e-4);
  EXPECT_LT(weight.worst, 0.015);
  EXPECT_LT(weight.rms(), 1.5e-3);
  // A wrong digit in a constant would show.
  EXPECT_LT(material_x.rms(), 0.03);
  EXPECT_LT(material_x_f0.rms(), 0.01);
  EXPECT_LT(karis.rms(), 0.2);
  EXPECT_LT(karis_f0.rms(), 0.05);
}

TEST(GgxAlbedo, IsItsClosedFormAtTheRoughestNormal) {
  // 1 - ln 2: see tests/specular_models_test.cpp.
  EXPECT_NEAR(GgxAlbedoLoss::evaluate(1.0, 1.0), std::numbers::ln2, 1e-6);
}

TEST(GgxAlbedo, AverageLossIsThatOfTheTable) {
  // 2 ∫ loss μ dμ by Gauss-Legendre panels that shrink towards 0, where the loss bends; the line's own splines are good
  // to 1 % below alpha .01 and better above.
  for (const double alpha : {0.001, 0.005, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0}) {
    double average = 0.0;
    for (int panel = 0; panel < 40; ++panel) {
      const double upper = std::ldexp(1.0, -panel), lower = panel < 39 ? 0.5 * upper : 0.0;
      for (const auto& [mu, weight] : gauss_legendre(24, lower, upper)) {
        average += 2.0 * weight * mu * GgxAlbedoLoss::evaluate(mu, alpha);
      }
    }
    EXPECT_NEAR(GgxAverageLoss::evaluate(alpha), average, (alpha < 0.02 ? 0.02 : 2e-3) * average) << alpha;
  }
}

// ---- compensated lobes ------------------------------------------------------------------------------------------

/// ∫ f cos θ_i dω_i: the lobe's part by the integral above, and the rest, smooth, by quadrature over the light's cosine
/// (it has no azimuth).
double white_furnace(std::string_view name, double alpha, double cosine) {
  const std::vector<double> flat = flat_of(name, {{"f0", 1.0}, {"alpha", alpha}});
  const std::vector<double> single = flat_of("specular_ggx", {{"f0", 1.0}, {"alpha", alpha}});
  const Model& model = find_model(name);
  const Model& lobe = find_model("specular_ggx");
  const Direction wo = direction(std::acos(cosine), 0.0);
  if (name == "specular_ggx_turquin") {
    // The lobe, scaled by what depends on the view alone.
    const Direction wi = direction(0.5, 2.0);
    return albedo(cosine, alpha) * model.evaluate(flat, wi, wo).x / lobe.evaluate(single, wi, wo).x;
  }
  double rest = 0.0;
  for (int panel = 0; panel < 24; ++panel) {
    const double upper = std::ldexp(1.0, -panel), lower = panel < 23 ? 0.5 * upper : 0.0;
    for (const auto& [mu, weight] : gauss_legendre(12, lower, upper)) {
      const Direction wi = direction(std::acos(mu), 2.0);
      rest += 2.0 * pi * weight * mu * (model.evaluate(flat, wi, wo).x - lobe.evaluate(single, wi, wo).x);
    }
  }
  return albedo(cosine, alpha) + rest;
}

TEST(CompensatedGgx, WhiteFurnace) {
  // Exact but for the table: 4.5e-4 of E, which Turquin divides by E ≥ .3.
  for (const char* name : {"specular_ggx_turquin", "specular_ggx_kulla_conty", "specular_ggx_fdez_aguera"}) {
    double worst = 0.0;
    for (const double alpha : {0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 1.0}) {
      for (const double cosine : {0.02, 0.05, 0.2, 0.5, 0.8, 1.0}) {
        const double found = white_furnace(name, alpha, cosine);
        worst = std::max(worst, std::abs(found - 1.0));
        EXPECT_NEAR(found, 1.0, 1e-3) << name << ", alpha " << alpha << ", cosine " << cosine;
      }
    }
    std::printf("%-26s white furnace to %.1e\n", name, worst);
  }
}

TEST(CompensatedGgx, Values) {
  // α = 1, both at the normal: D = 1/π, V = 1/4, so the lobe is 1/(4π); E = 1 - ln 2 = .30685282 (closed form).
  const Direction normal{0.0, 0.0, 1.0};
  const double lobe = 1.0 / (4.0 * pi), e = 1.0 - std::numbers::ln2;
  // Turquin, f0 = .5: F = .5; 1 + .5 (1 - E)/E.
  EXPECT_NEAR(value("specular_ggx_turquin", {{"f0", 0.5}, {"alpha", 1.0}}, normal, normal),
              0.5 * lobe * (1.0 + 0.5 * (1.0 - e) / e), 1e-6);
  // Kulla-Conty: F_avg = 11/21; E_avg = 1 - .5909 by the integral.
  const double average_loss = GgxAverageLoss::evaluate(1.0), f = 11.0 / 21.0;
  EXPECT_NEAR(average_loss, 0.5909, 1e-4);
  EXPECT_NEAR(value("specular_ggx_kulla_conty", {{"f0", 0.5}, {"alpha", 1.0}}, normal, normal),
              0.5 * lobe +
                  (1.0 - e) * (1.0 - e) / (pi * average_loss) * f * f * (1.0 - average_loss) / (1.0 - f * average_loss),
              1e-6);
  EXPECT_NEAR(
      value("specular_ggx_kulla_conty", {{"f0", 0.5}, {"alpha", 1.0}, {"average_fresnel", 1.0}}, normal, normal),
      0.5 * lobe + (1.0 - e) * (1.0 - e) / (pi * average_loss) * f * (1.0 - average_loss) / (1.0 - f * average_loss),
      1e-6);
  // Fdez-Agüera: E_F = E (.5 + .5 w), w the mean of (1 - V·H)⁵.
  const double w = grazing_albedo(1.0, 1.0) / e, albedo_f = e * (0.5 + 0.5 * w);
  EXPECT_NEAR(value("specular_ggx_fdez_aguera", {{"f0", 0.5}, {"alpha", 1.0}}, normal, normal),
              0.5 * lobe + albedo_f * f / (1.0 - f * (1.0 - e)) * (1.0 - e) / pi, 1e-6);
}

TEST(CompensatedGgx, SmoothSurfacesNeedNone) {
  for (const char* name : {"specular_ggx_turquin", "specular_ggx_kulla_conty", "specular_ggx_fdez_aguera"}) {
    const Direction wi = direction(0.7, 0.0), wo = direction(0.7, pi);
    const double lobe = value("specular_ggx", {{"f0", 0.9}, {"alpha", 0.001}}, wi, wo);
    EXPECT_NEAR(value(name, {{"f0", 0.9}, {"alpha", 0.001}}, wi, wo), lobe, 1e-4 * lobe) << name;
  }
}

TEST(Compensation, TakesAnyLobe) {
  // Beckmann facets with separable masking, their albedos by quadrature: all three return the light.
  constexpr double alpha = 0.6;
  const auto lobe = [&](const Direction& wi, const Direction& wo) {
    const Geometry<double> g = make_geometry(wi, wo);
    return BeckmannDistribution::at(g, alpha) * SmithBeckmannMasking::at(g, alpha) / (4.0 * wi.z * wo.z);
  };
  const auto lobe_albedo = [&](double cosine) {
    const Direction wo = direction(std::acos(cosine), 0.0);
    double sum = 0.0;
    for (const auto& [mu, weight] : gauss_legendre(48, 0.0, 1.0)) {
      for (int k = 0; k < 96; ++k) {
        sum += weight * mu * 2.0 * pi / 96 * lobe(direction(std::acos(mu), 2.0 * pi * (k + 0.5) / 96), wo);
      }
    }
    return sum;
  };
  std::vector<QuadraturePoint> lights = gauss_legendre(48, 0.0, 1.0);
  std::vector<double> losses;
  double average_loss = 0.0;
  for (const auto& [mu, weight] : lights) {
    losses.push_back(1.0 - lobe_albedo(mu));
    average_loss += 2.0 * weight * mu * losses.back();
  }
  const Rgb white{1.0, 1.0, 1.0};
  for (const double cosine : {0.15, 0.5, 0.9}) {
    const double e = lobe_albedo(cosine), loss = 1.0 - e;
    EXPECT_GT(loss, 0.02);
    EXPECT_NEAR(e * turquin_scale(white, loss).x, 1.0, 1e-12);
    EXPECT_NEAR(e + pi * fdez_aguera_lobe(white, white * e, loss).x, 1.0, 1e-12);
    double compensated = e;
    for (std::size_t i = 0; i < lights.size(); ++i) {
      compensated +=
          2.0 * pi * lights[i].weight * lights[i].x * kulla_conty_lobe(white, white, losses[i], loss, average_loss).x;
    }
    EXPECT_NEAR(compensated, 1.0, 1e-12);
  }
}

TEST(Compensation, BouncesAddUpToKullaAndContysFraction) {
  // Light of bounce n + 1 ≥ 2 has met F_avg n + 1 times and stayed inside n - 1 times more: F² E Σ (F (1 - E))^k.
  const double average_loss = 0.4, f = 0.7;
  double sum = 0.0, inside = 1.0;
  for (int bounce = 0; bounce < 200; ++bounce, inside *= f * average_loss) sum += f * f * (1.0 - average_loss) * inside;
  EXPECT_NEAR(kulla_conty_lobe(Rgb{f * f, f * f, f * f}, Rgb{f, f, f}, 0.3, 0.2, average_loss).x,
              sum * 0.3 * 0.2 / (pi * average_loss), 1e-14);
}

// ---- haze -------------------------------------------------------------------------------------------------------

TEST(SpecularHaze, Values) {
  // α = .1, extent 3: halo α = .4, P = 1/16. f0 = .04 < P: the limit is f0/P = .64, half of it k = .32;
  // r = .04 + 15/16 · .32 = .34, weight .32/.34.
  const Haze<double> haze({0.04, 0.04, 0.04}, 0.1, 0.5, 3.0);
  EXPECT_NEAR(haze.wide_alpha, 0.4, 1e-15);
  EXPECT_NEAR(0.04 * haze.gain, 0.34, 1e-14);
  EXPECT_NEAR(haze.weight, 0.32 / 0.34, 1e-14);
  // f0 = .5 > P: the limit is (1 - f0)/(1 - P) = 8/15; all of it makes r = 1.
  const Haze<double> metal({0.5, 0.4, 0.3}, 0.1, 1.0, 3.0);
  EXPECT_NEAR(metal.gain, 2.0, 1e-14);
  EXPECT_NEAR(metal.weight, 8.0 / 15.0, 1e-14);
}

TEST(SpecularHaze, PeakStaysAndHalosGrow) {
  // At the normal both lobes are D/4, and their peaks' ratio is P: F (lerp of peaks) is what f0 alone would give.
  const Direction normal{0.0, 0.0, 1.0};
  for (const double f0 : {0.02, 0.2, 0.9}) {
    const double sharp = value("specular_ggx", {{"f0", f0}, {"alpha", 0.1}}, normal, normal);
    double halo = 0.0;
    for (const double haziness : {0.0, 0.3, 0.7, 1.0}) {
      const Parameters p{{"f0", f0}, {"alpha", 0.1}, {"haziness", haziness}, {"haze_extent", 4.0}};
      EXPECT_NEAR(value("specular_haze", p, normal, normal), sharp, 1e-12 * sharp) << f0 << " " << haziness;
      const double aside = value("specular_haze", p, direction(radians(50.0), 0.0), normal);
      EXPECT_GT(aside, halo);
      halo = aside;
    }
  }
  // Without haze or extent: the sharp lobe.
  const Direction wi = direction(0.6, 0.3), wo = direction(0.8, 2.9);
  const double lobe = value("specular_ggx", {{"f0", 0.3}, {"alpha", 0.2}}, wi, wo);
  EXPECT_NEAR(value("specular_haze", {{"f0", 0.3}, {"alpha", 0.2}, {"haziness", 0.0}}, wi, wo), lobe, 1e-12 * lobe);
  EXPECT_NEAR(value("specular_haze", {{"f0", 0.3}, {"alpha", 0.2}, {"haziness", 1.0}, {"haze_extent", 0.0}}, wi, wo),
              lobe, 1e-12 * lobe);
}

}  // namespace
}  // namespace lobefit
