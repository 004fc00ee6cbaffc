// Light scattered back by a slab, against adding-doubling, Monte Carlo, and the limits that have closed forms.

#include "models/substrate/thin_scattering.h"

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>

#include "evaluate/shader.h"
#include "evaluate/single.h"
#include "fit/dual.h"
#include "models/substrate/albedo_inversion.h"
#include "reference/estimate.h"
#include "reference/layered/adding_doubling.h"
#include "reference/layered/layered_surface.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/shader_interpreter.h"

namespace lobefit {

/// The slab as a model, for the rooms that take one.
struct ThinSlab {
  static constexpr ModelInfo info{.name = "thin_slab", .title = "Thin slab", .source = "here", .reciprocal = true};

  template <class T>
  struct Parameters {
    Vec3<T> single_scattering_albedo, optical_depth;
    T g;
  };
  template <class P, class Visit>
  static constexpr void describe(P& p, Visit&& visit) {
    visit(p.single_scattering_albedo, ParameterInfo{.name = "single_scattering_albedo", .initial = 0.9});
    visit(p.optical_depth, ParameterInfo{.name = "optical_depth", .upper = 100.0, .initial = 1.0});
    visit(p.g, ParameterInfo{.name = "g", .lower = -0.9, .upper = 0.9, .initial = 0.3});
  }
  template <class T, class G>
  LOBEFIT_TEXT static Vec3<T> evaluate(const Parameters<T>& p, const Geometry<G>& g) {
    return thin_scattering(p.single_scattering_albedo, p.optical_depth, p.g, g);
  }
};

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

struct Slab {
  double albedo, depth, g;

  template <class T = double>
  T value(const Direction& wi, const Direction& wo) const {
    const Vec3<T> colour{T(albedo), T(albedo), T(albedo)}, depths{T(depth), T(depth), T(depth)};
    const auto narrow = [](const Direction& d) { return Vec3<T>{T(d.x), T(d.y), T(d.z)}; };
    return thin_scattering(colour, depths, T(g), make_geometry(narrow(wi), narrow(wo))).x;
  }
  double value(double mu_i, double mu_o, double phi) const {
    return value(direction(std::acos(mu_i), 0.0), direction(std::acos(mu_o), phi));
  }
  /// ∫ f cos θ dω by quadrature.
  double directional_albedo(double mu) const {
    double sum = 0.0;
    for (const auto& [t, weight] : gauss_legendre(48, 0.0, 1.0)) {
      for (const auto& [phi, arc] : gauss_legendre(g == 0.0 ? 1 : 48, 0.0, pi)) {
        sum += 2.0 * arc * weight * 2.0 * t * t * t * value(mu, t * t, phi);
      }
    }
    return sum;
  }
  LayerStack stack() const {
    LayerStack result;
    result.layers.push_back(MediumLayer{.albedo = {albedo, albedo, albedo}, .g = g, .thickness = depth});
    result.bottom = DiffuseLayer{};
    return result;
  }
};

struct Errors {
  double worst = 0.0, sum2 = 0.0;
  std::size_t count = 0;

  void add(double error) {
    worst = std::max(worst, std::abs(error));
    sum2 += error * error;
    ++count;
  }
  void add(const Errors& other) {
    worst = std::max(worst, other.worst);
    sum2 += other.sum2;
    count += other.count;
  }
  double rms() const { return std::sqrt(sum2 / static_cast<double>(count)); }
};

struct SlabErrors {
  Errors value, albedo;  // of f, relative; of the directional albedo
};

SlabErrors compare(const std::vector<Slab>& slabs, const std::vector<double>& cosines,
                   const std::vector<double>& azimuths, const AddingDoublingOptions& options) {
  std::vector<SlabErrors> each(slabs.size());
  tbb::parallel_for(std::size_t{0}, slabs.size(), [&](std::size_t k) {
    const AddingDoubling exact(slabs[k].stack(), cosines, cosines, options);
    for (std::size_t i = 0; i < cosines.size(); ++i) {
      for (std::size_t o = 0; o <= i; ++o) {
        for (const double phi : azimuths) {
          each[k].value.add(slabs[k].value(cosines[i], cosines[o], phi) / exact.value(i, o, phi).x - 1.0);
        }
      }
      each[k].albedo.add(slabs[k].directional_albedo(cosines[i]) - exact.albedo(i).x);
    }
  });
  SlabErrors all;
  for (const SlabErrors& errors : each) all.value.add(errors.value), all.albedo.add(errors.albedo);
  return all;
}

void print(const std::string& what, const SlabErrors& errors) {
  std::printf("%s: f %.4f at worst, %.4f rms; albedo %.4f, %.4f\n", what.c_str(), errors.value.worst,
              errors.value.rms(), errors.albedo.worst, errors.albedo.rms());
}

// ---- isotropic media --------------------------------------------------------------------------------------------

TEST(ThinScattering, IsotropicSlabsAgreeWithAddingDoubling) {
  // Off the fit's grid, and beyond its ends.
  UniformNumbers uniform(61);
  std::vector<Slab> slabs;
  for (int k = 0; k < 300; ++k) {
    const double gamma = uniform(), depth = std::pow(10.0, uniform.between(-3.5, 2.0));
    slabs.push_back({1.0 - gamma * gamma, depth, 0.0});
  }
  for (const double depth : {0.001, 0.03, 0.3, 1.3, 7.0, 40.0, 100.0}) slabs.push_back({1.0, depth, 0.0});
  const SlabErrors errors = compare(slabs, {0.0021, 0.011, 0.043, 0.1, 0.17, 0.31, 0.47, 0.62, 0.77, 0.89, 1.0}, {0.0},
                                    {.streams = 40, .modes = 1});
  print("isotropic", errors);
  EXPECT_LT(errors.value.worst, 0.0062);
  EXPECT_LT(errors.value.rms(), 0.0016);
  EXPECT_LT(errors.albedo.worst, 0.004);
  EXPECT_LT(errors.albedo.rms(), 0.0006);
}

/// H(μ) = exp(-μ/π ∫ ln(1 - ω θ cot θ)/(cos²θ + μ² sin²θ) dθ) over [0, π/2] (Chandrasekhar 1960, chapter V).
double chandrasekhar_h(double albedo, double mu) {
  double sum = 0.0;
  // Cubed steps from both ends: at ω = 1 the logarithm is singular at 0, and at π/2 the quotient has the width of μ.
  const auto integrand = [&](double theta) {
    const double sine = std::sin(theta), cosine = std::cos(theta);
    const double rest = 1.0 - theta * cosine / sine;
    return std::log(1.0 - albedo +
                    albedo * (theta < 1e-2 ? theta * theta / 3.0 * (1.0 + theta * theta / 15.0) : rest)) /
           (cosine * cosine + mu * mu * sine * sine);
  };
  const double middle = 0.25 * pi;
  for (const auto& [t, weight] : gauss_legendre(200, 0.0, 1.0)) {
    const double step = weight * 3.0 * t * t * middle;
    sum += step * (integrand(middle * t * t * t) + integrand(0.5 * pi - middle * t * t * t));
  }
  return std::exp(-mu / pi * sum);
}

TEST(ThinScattering, SemiInfiniteMediumIsChandrasekhars) {
  // His table XI, ω = 1.
  const struct {
    double mu, h;
  } published[] = {{.05, 1.1366}, {.1, 1.2474}, {.2, 1.4503}, {.5, 2.0128}, {.8, 2.5527}, {.9, 2.7306}, {1.0, 2.9078}};
  for (const auto& [mu, h] : published) EXPECT_NEAR(chandrasekhar_h(1.0, mu), h, 6e-5) << mu;
  Errors errors;
  for (const double albedo : {1.0, 0.9999, 0.99, 0.9, 0.7, 0.3, 0.05}) {
    for (const double mu_i : {0.01, 0.1, 0.35, 0.6, 1.0}) {
      for (const double mu_o : {0.03, 0.2, 0.5, 0.8, 1.0}) {
        const double truth =
            albedo * chandrasekhar_h(albedo, mu_i) * chandrasekhar_h(albedo, mu_o) / (4.0 * pi * (mu_i + mu_o));
        errors.add(Slab{albedo, infinity, 0.0}.value(mu_i, mu_o, 1.0) / truth - 1.0);
      }
    }
  }
  std::printf("semi-infinite, isotropic: %.4f at worst, %.4f rms\n", errors.worst, errors.rms());
  EXPECT_LT(errors.worst, 0.006);
  EXPECT_LT(errors.rms(), 0.0021);
}

// ---- other media ------------------------------------------------------------------------------------------------

class ThinScatteringOf : public ::testing::TestWithParam<std::array<double, 5>> {};

TEST_P(ThinScatteringOf, AgreesWithAddingDoublingAsStated) {
  const auto& [g, value_worst, value_rms, albedo_worst, albedo_rms] = GetParam();
  std::vector<Slab> slabs;
  for (const double albedo : {0.3, 0.6, 0.9, 1.0}) {
    for (const double depth : {0.02, 0.1, 0.5, 2.0, 6.0, 20.0}) slabs.push_back({albedo, depth, g});
  }
  // |g|^40 < 2e-4.
  const SlabErrors errors = compare(slabs, {0.05, 0.2, 0.4, 0.65, 0.98}, {0.0, 0.25 * pi, 0.5 * pi, 0.75 * pi, pi},
                                    {.streams = 20, .modes = 40});
  print("g = " + std::to_string(g), errors);
  EXPECT_LT(errors.value.worst, value_worst);
  EXPECT_LT(errors.value.rms(), value_rms);
  EXPECT_LT(errors.albedo.worst, albedo_worst);
  EXPECT_LT(errors.albedo.rms(), albedo_rms);
}

INSTANTIATE_TEST_SUITE_P(
    G, ThinScatteringOf,
    ::testing::Values(std::array{-0.8, 0.81, 0.245, 0.162, 0.051}, std::array{-0.5, 0.302, 0.0585, 0.091, 0.0215},
                      std::array{-0.2, 0.0302, 0.0142, 0.0127, 0.0041}, std::array{0.2, 0.0655, 0.023, 0.0168, 0.0062},
                      std::array{0.5, 0.29, 0.0945, 0.0755, 0.0256}, std::array{0.8, 0.805, 0.246, 0.203, 0.07}));

TEST(ThinScattering, VeryThinSlabsScatterOnce) {
  // Relative to single scattering of no depth, both the second scattering and attenuation are of order τ ln(1/τ).
  for (const double g : {-0.9, -0.5, 0.0, 0.5, 0.9}) {
    for (const auto& [wi, wo] : random_pairs(50, 62)) {
      const double cosine = -dot(wi, wo), depth = 1e-7;
      const double phase = (1.0 - g * g) / (4.0 * pi * std::pow(1.0 + g * g - 2.0 * g * cosine, 1.5));
      const double truth = 0.8 * phase * depth / (wi.z * wo.z);
      const double tolerance = 20.0 * depth * (1.0 / wi.z + 1.0 / wo.z) * std::max(1.0, 1.0 / (4.0 * pi * phase));
      if (std::min(wi.z, wo.z) < 0.01) continue;
      EXPECT_NEAR(Slab({0.8, depth, g}).value(wi, wo) / truth, 1.0, tolerance) << g << " " << wi.z << " " << wo.z;
    }
  }
}

// 24 comparisons at 4 standard errors of 32 replicates (probability .00037 each), beyond what the text errs against
// adding-doubling: a false alarm in at most 0.9 % of seeds.
TEST(ThinScattering, AgreesWithMonteCarlo) {
  UniformNumbers uniform(63);
  for (int k = 0; k < 24; ++k) {
    const Slab slab{uniform.between(0.2, 1.0), std::pow(10.0, uniform.between(-1.0, 1.0)), 0.0};
    const Direction wi = direction(radians(uniform.between(0.0, 80.0)), 0.0);
    const Direction wo = direction(radians(uniform.between(0.0, 80.0)), uniform.between(0.0, pi));
    const LayeredSurface surface(slab.stack());
    std::array<double, replicate_count> values;
    tbb::parallel_for(std::uint32_t{0}, std::uint32_t{replicate_count}, [&](std::uint32_t r) {
      Rgb value;
      surface.sample_row(wo, {&wi, 1}, SamplePoints(Sampler::sobol, {64, static_cast<std::uint32_t>(k), r}), 1024,
                         false, {.values = {&value, 1}});
      values[r] = value.x;
    });
    const MeanAndError estimate = mean_and_error(std::span<const double>(values));
    EXPECT_LT(estimate.standard_error, 0.01 * estimate.mean);
    EXPECT_NEAR(slab.value(wi, wo), estimate.mean, 4.0 * estimate.standard_error + 0.0062 * estimate.mean)
        << slab.albedo << " " << slab.depth;
  }
}

// ---- laws -------------------------------------------------------------------------------------------------------

std::vector<Slab> varied_slabs() {
  std::vector<Slab> slabs;
  for (const double albedo : {0.0, 1e-6, 0.5, 0.97, 1.0}) {
    for (const double depth : {0.0, 1e-12, 1e-3, 0.2, 3.0, 80.0, 1e5, infinity}) {
      for (const double g : {-0.9, -0.4, 0.0, 0.4, 0.9}) slabs.push_back({albedo, depth, g});
    }
  }
  return slabs;
}

TEST(ThinScattering, IsReciprocalToTheLastBit) {
  for (const Slab& slab : varied_slabs()) {
    for (const auto& [wi, wo] : random_pairs(20, 65)) EXPECT_EQ(slab.value(wi, wo), slab.value(wo, wi));
  }
}

TEST(ThinScattering, IsFiniteAndNotNegative) {
  std::vector<DirectionPair> pairs = hostile_pairs();
  for (const DirectionPair& pair : random_pairs(200, 66)) pairs.push_back(pair);
  for (const Slab& slab : varied_slabs()) {
    for (const auto& [wi, wo] : pairs) {
      const double value = slab.value(wi, wo);
      ASSERT_TRUE(value >= 0.0 && std::isfinite(value)) << slab.albedo << " " << slab.depth << " " << slab.g;
      const float single = slab.value<Single>(wi, wo).value;
      ASSERT_TRUE(single >= 0.0f && std::isfinite(single)) << slab.albedo << " " << slab.depth << " " << slab.g;
      if (slab.albedo == 0.0 || slab.depth == 0.0) {
        ASSERT_EQ(value, 0.0);
      }
    }
  }
}

TEST(ThinScattering, ReturnsNoMoreThanItReceives) {
  double most = 0.0;
  for (const double g : {-0.9, -0.7, -0.5, -0.3, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9}) {
    for (const double depth : {0.1, 1.0, 5.0, 30.0, 1e3, infinity}) {
      for (const double mu : {0.001, 0.01, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0}) {
        const double albedo = Slab{1.0, depth, g}.directional_albedo(mu);
        most = std::max(most, albedo);
        EXPECT_LE(albedo, 1.0) << g << " " << depth << " " << mu;
      }
    }
  }
  std::printf("largest directional albedo: %.5f\n", most);
}

TEST(ThinScattering, GrowsWithAlbedoAndDepth) {
  // A deeper slab returns more; where f is all but level, the errors of fit and similarity may win, as the header says.
  double fall = 0.0;
  UniformNumbers uniform(67);
  for (const auto& [wi, wo] : random_pairs(5000, 67)) {
    const double albedo = uniform.between(0.0, 0.95), depth = std::pow(10.0, uniform.between(-3.0, 3.0));
    const double g = uniform.between(-0.5, 0.5);
    const double value = Slab{albedo, depth, g}.value(wi, wo);
    EXPECT_GT(Slab({albedo + 0.05, depth, g}).value(wi, wo), value) << albedo << " " << depth << " " << g;
    fall = std::max(fall, 1.0 - Slab({albedo, 1.5 * depth, g}).value(wi, wo) / value);
  }
  std::printf("a slab deepened by half returns less by %.4f at most\n", fall);
  EXPECT_LT(fall, 0.0045);
}

// ---- one text, all scalars --------------------------------------------------------------------------------------

TEST(ThinScattering, DualHasTheDerivatives) {
  UniformNumbers uniform(68);
  for (const auto& [wi, wo] : random_pairs(300, 69)) {
    const std::array<double, 3> at{uniform.between(0.02, 0.98), std::pow(10.0, uniform.between(-2.0, 1.5)),
                                   uniform.between(-0.85, 0.85)};
    using D = Dual<3>;
    const D albedo = D::variable(at[0], 0), depth = D::variable(at[1], 1), g = D::variable(at[2], 2);
    const D value =
        thin_scattering(Vec3<D>{albedo, albedo, albedo}, Vec3<D>{depth, depth, depth}, g, make_geometry(wi, wo)).x;
    const auto plain = [&](const std::array<double, 3>& p) { return Slab{p[0], p[1], p[2]}.value(wi, wo); };
    EXPECT_NEAR(value.value, plain(at), 1e-13 * plain(at));
    for (std::size_t k = 0; k < 3; ++k) {
      const double step = 1e-5 * (k == 1 ? at[1] : 1.0);
      std::array<double, 3> above = at, below = at;
      above[k] += step, below[k] -= step;
      const double slope = (plain(above) - plain(below)) / (2.0 * step);
      EXPECT_NEAR(value.derivative[k], slope, 1e-6 * (std::abs(slope) + plain(at) / (k == 1 ? at[1] : 1.0)))
          << k << " at " << at[0] << " " << at[1] << " " << at[2];
    }
  }
}

TEST(ThinScattering, DerivativesStayFinite) {
  for (const Slab& slab : varied_slabs()) {
    if (slab.depth == infinity) continue;  // not a parameter's value
    for (const auto& [wi, wo] : hostile_pairs()) {
      using D = Dual<3>;
      const D albedo = D::variable(slab.albedo, 0), depth = D::variable(slab.depth, 1), g = D::variable(slab.g, 2);
      const D value =
          thin_scattering(Vec3<D>{albedo, albedo, albedo}, Vec3<D>{depth, depth, depth}, g, make_geometry(wi, wo)).x;
      for (const double derivative : value.derivative) {
        ASSERT_TRUE(std::isfinite(derivative)) << slab.albedo << " " << slab.depth << " " << slab.g;
      }
    }
  }
}

TEST(ThinScattering, SingleAgreesWithDouble) {
  double worst = 0.0;
  UniformNumbers uniform(70);
  for (const auto& [wi, wo] : random_pairs(20000, 71)) {
    const Slab slab{uniform(), std::pow(10.0, uniform.between(-4.0, 4.0)), uniform.between(-0.9, 0.9)};
    worst = std::max(worst, std::abs(slab.value<Single>(wi, wo).value / slab.value(wi, wo) - 1.0));
  }
  std::printf("float: %.1e at worst\n", worst);
  EXPECT_LT(worst, 1e-4);
}

class ThinScatteringShader : public ::testing::TestWithParam<std::string> {
 protected:
  const Shader shader_ = trace_shader<ThinSlab>();
  static constexpr std::array<double, 7> flat_{0.3, 0.8, 1.0, 0.05, 0.7, 20.0, -0.4};

  std::string text() const {
    std::vector<ShaderParameter> parameters;
    for (const ParameterInfo& info : describe_parameters<ThinSlab>()) {
      const auto first = flat_.begin() + info.offset;
      parameters.push_back({info, {first, first + info.components}, ""});
    }
    return print_shader(shader_, GetParam(), ThinSlab::info, parameters, {});
  }
  template <class Value>
  void expect_same(Value&& value, double tolerance) const {
    const auto p = unflatten<ThinSlab, double>(std::span<const double>(flat_));
    for (const auto& [wi, wo] : random_pairs(100, 72)) {
      const Rgb truth = evaluate_brdf<ThinSlab>(p, wi, wo);
      const ShaderValue shader = value(ShaderValue{wi.x, wi.y, wi.z}, ShaderValue{wo.x, wo.y, wo.z});
      const std::array<double, 3> expected{truth.x, truth.y, truth.z};
      for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(shader.at(k), expected[k], tolerance * (1.0 + expected[k]));
    }
  }
};

INSTANTIATE_TEST_SUITE_P(Languages, ThinScatteringShader, ::testing::Values("hlsl", "glsl", "c", "wgsl"),
                         [](const auto& test) { return test.param; });

TEST_P(ThinScatteringShader, GraphEqualsTheText) {
  const GraphInterpreter interpreter(shader_);
  expect_same(
      [&](const ShaderValue& wi, const ShaderValue& wo) {
        return interpreter.run({{"wi", wi},
                                {"wo", wo},
                                {"p.single_scattering_albedo", {flat_[0], flat_[1], flat_[2]}},
                                {"p.optical_depth", {flat_[3], flat_[4], flat_[5]}},
                                {"p.g", {flat_[6]}}});
      },
      1e-12);
}

TEST_P(ThinScatteringShader, PrintedTextEqualsTheText) {
  TextInterpreter interpreter(text());
  const TextInterpreter::Variables members = interpreter.members("Lobefit_thin_slab_Fitted");
  expect_same(
      [&](const ShaderValue& wi, const ShaderValue& wo) {
        return interpreter.call("Lobefit_thin_slab", {wi, wo}, members);
      },
      2e-6);  // literals are printed in float precision
}

TEST(ThinScattering, CostsNoTableReads) {
  const OperationCount count = count_operations(trace_shader<ThinSlab>());
  std::printf(
      "a shader's operations for three channels: %d multiply-adds, %d divisions, %d roots, %d transcendental, "
      "%d comparisons\n",
      count.add_multiply, count.divide, count.square_root, count.transcendental, count.compare_select);
  EXPECT_EQ(count.table_read, 0);
}

// ---- the colour of a semi-infinite medium -----------------------------------------------------------------------

TEST(AlbedoInversion, IsTheInverse) {
  for (const double g : {-0.9, -0.3, 0.0, 0.5, 0.9}) {
    for (int k = 0; k <= 200; ++k) {
      const double rho = k / 200.0;
      const double omega = SingleScatteringAlbedo::evaluate(rho, g);
      EXPECT_GE(omega, 0.0);
      EXPECT_LE(omega, 1.0);
      // ω rounds to 2e-16, and s is the root of 1 - ω.
      EXPECT_NEAR(SemiInfiniteAlbedo::evaluate(omega, g), rho, rho > 0.999 ? 1e-7 : 1e-11) << g;
    }
    EXPECT_EQ(SingleScatteringAlbedo::evaluate(1.0, g), 1.0);
    EXPECT_EQ(SemiInfiniteAlbedo::evaluate(1.0, g), 1.0);
    EXPECT_NEAR(SingleScatteringAlbedo::evaluate(0.0, g), 0.0, 1e-15);
    EXPECT_EQ(SemiInfiniteAlbedo::evaluate(0.0, g), 0.0);
  }
}

TEST(AlbedoInversion, IsKullaAndContysForm) {
  for (const double rho : {0.0, 0.05, 0.3, 0.6, 0.9, 0.99}) {
    for (const double g : {-0.5, 0.0, 0.8}) {
      // Their constants have six digits.
      const double s = 4.09712 + 4.20863 * rho - std::sqrt(9.59217 + 41.6808 * rho + 17.7126 * rho * rho);
      EXPECT_NEAR(SingleScatteringAlbedo::evaluate(rho, g), (1.0 - s * s) / (1.0 - g * s * s), 1e-4) << rho;
    }
  }
}

TEST(AlbedoInversion, DerivativesStayFinite) {
  using D = Dual<2>;
  for (const double x : {0.0, 1e-9, 0.5, 1.0 - 1e-9, 1.0}) {
    for (const double g : {-0.9, 0.0, 0.9}) {
      const D omega = SingleScatteringAlbedo::evaluate(D::variable(x, 0), D::variable(g, 1));
      const D rho = SemiInfiniteAlbedo::evaluate(D::variable(x, 0), D::variable(g, 1));
      for (const D& result : {omega, rho}) {
        EXPECT_TRUE(std::isfinite(result.derivative[0]) && std::isfinite(result.derivative[1])) << x << " " << g;
      }
    }
  }
}

TEST(AlbedoInversion, AgreesWithAddingDoubling) {
  std::vector<double> cosines, weights;
  for (const auto& [mu, weight] : gauss_legendre(16, 0.0, 1.0)) {
    cosines.push_back(mu);
    weights.push_back(2.0 * mu * weight);
  }
  for (const double g : {0.0, 0.5, 0.8}) {
    Errors errors;
    for (const double albedo : {0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.995}) {
      const AddingDoubling exact(Slab{albedo, 2000.0, g}.stack(), {}, cosines, {.streams = 24, .modes = 1});
      double truth = 0.0;
      for (std::size_t k = 0; k < cosines.size(); ++k) truth += weights[k] * exact.albedo(k).x;
      errors.add(SemiInfiniteAlbedo::evaluate(albedo, g) - truth);
    }
    std::printf("albedo under diffuse light, g = %.1f: %.4f at worst, %.4f rms\n", g, errors.worst, errors.rms());
    EXPECT_LT(errors.worst, g == 0.0 ? 0.0021 : 0.0014);
  }
}

}  // namespace
}  // namespace lobefit
