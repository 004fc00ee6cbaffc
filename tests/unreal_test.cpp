// Unreal's shading models: against values worked out apart from their texts, against the models that they must become
// where their parameters are neutral, and the skin's fit against the integral that it stands for.
//
// Values are 30-digit arithmetic (mpmath) on the formulas with N·H, V·H … of the vectors, from angles θ, φ of the pairs
//   side     30°, 25° and 60°, 115°
//   mirror   60°, 25° and 60°, 205°
//   back     80°, 25° and 20°, 155°
//   through 140°, 25° and 30°, 195°: light from behind
// with base_color .8 .5 .2, metallic .3, specular .6, roughness .4: α = .16.
#include <gtest/gtest.h>

#include <cmath>
#include <string_view>

#include "evaluate/float_model.h"
#include "models/unreal/clear_coat.h"
#include "models/unreal/preintegrated_skin.h"
#include "tests/model_values.h"
#include "tests/sphere_sampling.h"

namespace lobefit {
namespace {

Direction at(double theta, double phi) { return direction(radians(theta), radians(phi)); }

const DirectionPair side{at(30, 25), at(60, 115)}, mirror{at(60, 25), at(60, 205)}, back{at(80, 25), at(20, 155)},
    through{at(140, 25), at(30, 195)};

/// The surface that all values are of.
Material reference_surface(std::string_view name, Parameters parameters = {}) {
  Material material(name, {{"metallic", 0.3}, {"specular", 0.6}, {"roughness", 0.4}});
  material.color("base_color", {0.8, 0.5, 0.2});
  for (const auto& [parameter, value] : parameters) material.set(parameter, value);
  return material;
}

void expect_rgb(const Rgb& found, const Rgb& expected, double relative = 1e-13) {
  EXPECT_NEAR(found.x, expected.x, relative * std::abs(expected.x));
  EXPECT_NEAR(found.y, expected.y, relative * std::abs(expected.y));
  EXPECT_NEAR(found.z, expected.z, relative * std::abs(expected.z));
}

/// The surface of `name` with these parameters is DefaultLit's, for any roughness and metallic.
void expect_default_lit(std::string_view name, Parameters neutral) {
  for (const double roughness : {0.0, 0.05, 0.3, 1.0}) {
    for (const double metallic : {0.0, 0.4, 1.0}) {
      Material special(name, neutral);
      Material plain("unreal_default_lit");
      for (Material* material : {&special, &plain}) {
        material->set("roughness", roughness).set("metallic", metallic).color("base_color", {0.9, 0.4, 0.05});
      }
      for (const auto& [wi, wo] : random_pairs(200, 94)) expect_rgb(special(wi, wo), plain(wi, wo), 1e-11);
    }
  }
}

// ---- DefaultLit ---------------------------------------------------------------------------------------------------

TEST(UnrealDefaultLit, Values) {
  const Material isotropic = reference_surface("unreal_default_lit");
  expect_rgb(isotropic(side.wi, side.wo), {0.187072137249111788, 0.117327109879754601, 0.0475820825103974141});
  expect_rgb(isotropic(mirror.wi, mirror.wo), {3.35427789227912617, 2.35287451871119927, 1.35147114514327237});
  expect_rgb(isotropic(back.wi, back.wo), {0.197201448641093614, 0.124190340300132054, 0.0511792319591704935});
  // Anisotropy ½: αx = .24, αy = .08, and the exact joint visibility.
  const Material stretched = reference_surface("unreal_default_lit", {{"anisotropy", 0.5}});
  expect_rgb(stretched(side.wi, side.wo), {0.179112403086574671, 0.111984893080314071, 0.0448573830740534699});
  expect_rgb(stretched(mirror.wi, mirror.wo), {4.76820813556404509, 3.35074994226475178, 1.93329174896545846});
  expect_rgb(stretched(back.wi, back.wo), {0.184348633915060953, 0.115520090303349968, 0.0466915466916389831});
}

TEST(UnrealDefaultLit, IsLambertAndTheTerms) {
  for (const double roughness : {0.1, 0.5, 1.0}) {
    const Material lit("unreal_default_lit", {{"base_color", 0.6}, {"specular", 0.2}, {"roughness", roughness}});
    const Material d("d_ggx", {{"alpha", roughness * roughness}});
    const Material vis("vis_smith_joint_approx", {{"alpha", roughness * roughness}});
    // .016: 80 % of the grazing reflection.
    const Material f("f_unreal", {{"f0", 0.08 * 0.2}});
    for (const auto& [wi, wo] : random_pairs(200, 95)) {
      const double expected = 0.6 / pi + d(wi, wo).x * vis(wi, wo).x * f(wi, wo).x;
      EXPECT_NEAR(lit(wi, wo).x, expected, 1e-11 * expected);
    }
  }
}

TEST(UnrealDefaultLit, AnisotropyLeavesZeroByTheVisibilityAlone) {
  // The engine has two visibilities, of roots √(α² + (1 - α²) c²) and of (1 - α) c + α in their place. The second over
  // the first is largest at c = α/(1 + α), where its square is 2/(1 + α).
  for (const double alpha : {0.01, 0.09, 0.25, 1.0}) {
    const Parameters metal{{"metallic", 1.0}, {"base_color", 1.0}, {"roughness", std::sqrt(alpha)}};
    const Material isotropic("unreal_default_lit", metal);
    const Material nearly = Material("unreal_default_lit", metal).set("anisotropy", 1e-9);
    const auto jump = [&](const DirectionPair& pair) {
      return nearly(pair.wi, pair.wo).x / isotropic(pair.wi, pair.wo).x;
    };
    const double most = std::sqrt(2.0 / (1.0 + alpha)), low = degrees(std::acos(alpha / (1.0 + alpha)));
    EXPECT_NEAR(jump({at(low, 0), at(low, 70)}), most, 1e-6);
    for (const DirectionPair& pair : random_pairs(1000, 96)) {
      EXPECT_GE(jump(pair), 1.0 - 1e-5);
      EXPECT_LE(jump(pair), most + 1e-5);
    }
  }
}

// ---- ClearCoat ----------------------------------------------------------------------------------------------------

TEST(UnrealClearCoat, Values) {
  const Material coat = reference_surface("unreal_clear_coat", {{"clear_coat", 0.7}, {"clear_coat_roughness", 0.3}});
  expect_rgb(coat(side.wi, side.wo), {0.162010656976028662, 0.099538690324412749, 0.0391716224393801627});
  expect_rgb(coat(mirror.wi, mirror.wo), {3.92916296975145361, 3.22568169030342223, 2.53431370430206142});
  expect_rgb(coat(back.wi, back.wo), {0.164308272212956655, 0.101143580196061385, 0.0407221950846841836});
}

TEST(UnrealClearCoat, NoneIsDefaultLit) {
  expect_default_lit("unreal_clear_coat", {{"clear_coat", 0.0}});
  expect_default_lit("unreal_clear_coat", {{"clear_coat", 0.0}, {"clear_coat_roughness", 0.0}});
}

TEST(UnrealClearCoat, DimsTheDiffuseByTheFresnelOfBothWays) {
  // At normal incidence with a black film lobe's base: (1 - .04)² of Lambert, and the film's own lobe.
  const Direction normal{0.0, 0.0, 1.0};
  const Material coat("unreal_clear_coat", {{"specular", 0.0}, {"base_color", 0.5}, {"clear_coat_roughness", 1.0}});
  // α = 1: D = 1/π, V = ¼
  EXPECT_NEAR(coat(normal, normal).x, 0.96 * 0.96 * 0.5 / pi + 0.04 * 0.25 / pi, 1e-14);
}

TEST(UnrealClearCoat, BendsRaysNearlyAsRefractionDoes) {
  // Snell into n = 1.5: the refracted cosine is √(1 - (1 - c²)/2.25) = c/1.5 - blend.
  double worst = 0.0;
  for (int i = 0; i <= 1000; ++i) {
    const double c = i / 1000.0;
    worst = std::max(worst, std::abs(UnrealFilmBlend::evaluate(c) - (c / 1.5 - std::sqrt(1.0 - (1.0 - c * c) / 2.25))));
  }
  std::printf("the film's polynomial against Snell: off by at most %.4f\n", worst);
  EXPECT_LT(worst, 0.0043);
}

TEST(UnrealClearCoat, AFilmOverWhiteMetalAbsorbs) {
  // base_color/π where a transmittance would be base_color: at 60° in the mirror direction a path of 2/.8165 - 2 =
  // .4495 beyond the straight one takes (1/π)^.2247 = .773. A lossless film would take nothing.
  const Parameters metal{{"base_color", 1.0}, {"metallic", 1.0}, {"roughness", 0.5}, {"clear_coat_roughness", 1.0}};
  const Material coat("unreal_clear_coat", metal);
  const double film = 0.04 + 0.96 / 32.0, lobe = 1.0 / pi * 0.5;
  // The base's lobe: D = 16/π, the light outside, the view as the polynomial bends it.
  const double inside = 0.5 / 1.5 - UnrealFilmBlend::evaluate(0.5);
  const double base = 16.0 / pi * 0.5 / (0.5 * (inside * 0.75 + 0.25) + inside * (0.5 * 0.75 + 0.25));
  const double kept = (coat(mirror.wi, mirror.wo).x - film * lobe) / (base * square(1.0 - film));
  EXPECT_NEAR(kept, std::pow(1.0 / pi, 1.0 / inside - 1.0), 1e-12);
  EXPECT_NEAR(kept, 0.773, 0.005);
}

TEST(UnrealClearCoat, ASmoothBaseLosesTheRatioOfTheCosines) {
  // Facets of a mirror: V → 1/(4 N·L N·V'), where the light that a film of index 1.5 lets pass would leave by 1/(4 N·L
  // N·V).
  const Parameters metal{{"base_color", 1.0}, {"metallic", 1.0}, {"roughness", 0.05}};
  const Material coat = Material("unreal_clear_coat", metal).set("clear_coat_roughness", 1.0);
  const Material bare("unreal_default_lit", metal);
  const double inside = 0.5 / 1.5 - UnrealFilmBlend::evaluate(0.5);
  const double passed = square(1.0 - (0.04 + 0.96 / 32.0)) * std::pow(1.0 / pi, 1.0 / inside - 1.0);
  const double share = coat(mirror.wi, mirror.wo).x / bare(mirror.wi, mirror.wo).x / passed;
  EXPECT_NEAR(share, 0.5 / inside, 0.005);
  EXPECT_NEAR(share, 0.61, 0.01);
}

// ---- Cloth, SubsurfaceProfile ---------------------------------------------------------------------------------------

TEST(UnrealCloth, Values) {
  const Material cloth = reference_surface("unreal_cloth", {{"cloth", 0.7}}).color("fuzz_color", {0.1, 0.3, 0.6});
  expect_rgb(cloth(side.wi, side.wo), {0.186351675363890449, 0.129532435283382664, 0.0781611059025331786});
  expect_rgb(cloth(mirror.wi, mirror.wo), {1.13971567370450772, 0.805590901035280297, 0.478010024701136819});
  expect_rgb(cloth(back.wi, back.wo), {0.189429956432324859, 0.131402806269553946, 0.0787095239110504239});
}

TEST(UnrealCloth, NoneIsDefaultLit) { expect_default_lit("unreal_cloth", {{"cloth", 0.0}}); }

TEST(UnrealCloth, AllIsTheFuzzOfTheTerms) {
  const Material cloth("unreal_cloth", {{"cloth", 1.0}, {"base_color", 0.3}, {"fuzz_color", 0.7}, {"roughness", 0.6}});
  const Material d("d_ashikhmin_approx", {{"alpha", 0.36}}), vis("vis_cloth"), f("f_unreal", {{"f0", 0.7}});
  for (const auto& [wi, wo] : random_pairs(200, 97)) {
    const double expected = 0.3 / pi + d(wi, wo).x * vis(wi, wo).x * f(wi, wo).x;
    EXPECT_NEAR(cloth(wi, wo).x, expected, 1e-11 * expected);
  }
}

TEST(UnrealSubsurfaceProfile, Values) {
  const Material skin = reference_surface("unreal_subsurface_profile");
  expect_rgb(skin(side.wi, side.wo), {0.196167231899124338, 0.123431329749367887, 0.0506954275996114364});
  expect_rgb(skin(mirror.wi, mirror.wo), {2.47626160377242347, 1.73321815310081159, 0.990174702429199719});
  expect_rgb(skin(back.wi, back.wo), {0.213489835506793181, 0.135178158080145245, 0.056866480653497308});
}

TEST(UnrealSubsurfaceProfile, EqualLobesAreDefaultLit) {
  expect_default_lit("unreal_subsurface_profile", {{"first_roughness_scale", 1.0}, {"second_roughness_scale", 1.0}});
  expect_default_lit("unreal_subsurface_profile", {{"opacity", 0.0}});
}

TEST(UnrealSubsurfaceProfile, AnEndOfTheMixIsOneLobe) {
  for (const double mix : {0.0, 1.0}) {
    const Material skin("unreal_subsurface_profile", {{"lobe_mix", mix}, {"roughness", 0.5}});
    const Material lit("unreal_default_lit", {{"roughness", 0.5 * (mix == 0.0 ? 0.75 : 1.3)}});
    for (const auto& [wi, wo] : random_pairs(100, 98)) expect_rgb(skin(wi, wo), lit(wi, wo), 1e-11);
  }
}

// ---- what is added without N·L --------------------------------------------------------------------------------------

/// f |N·L|: what the engine adds, of a model whose DefaultLit part is black.
double term(const Material& material, const DirectionPair& pair) {
  return material(pair.wi, pair.wo).x * std::abs(pair.wi.z);
}
constexpr std::pair<std::string_view, double> black[] = {{"base_color", 0.0}, {"specular", 0.0}};

Material scatterer(std::string_view name, Parameters parameters) {
  Material material(name, parameters);
  for (const auto& [parameter, value] : black) material.set(parameter, value);
  return material;
}

TEST(UnrealSubsurface, Values) {
  const Material body =
      scatterer("unreal_subsurface", {{"subsurface_color", 1.0}, {"opacity", 0.4}, {"ambient_occlusion", 0.7}});
  EXPECT_NEAR(term(body, through), 1.4129717800347352, 1e-13);
  // F0 = 0 has no grazing reflection either.
  EXPECT_NEAR(term(body, mirror), 0.107674828473576474, 1e-14);
}

TEST(UnrealTwoSidedFoliage, Values) {
  const Material leaf = scatterer("unreal_two_sided_foliage", {{"subsurface_color", 1.0}});
  EXPECT_NEAR(term(leaf, through), 0.43402025472330494, 1e-13);
  EXPECT_NEAR(term(leaf, {at(60, 25), at(60, 205)}), 0.0, 1e-15);  // N·L = ½: the wrap ends
}

TEST(UnrealSubsurface, BlackIsDefaultLit) {
  for (const std::string_view name : {"unreal_subsurface", "unreal_two_sided_foliage", "unreal_preintegrated_skin"}) {
    expect_default_lit(name, {{"subsurface_color", 0.0}});
    expect_rgb(Material(name, {{"subsurface_color", 0.0}})(through.wi, through.wo), {0.0, 0.0, 0.0});
  }
}

TEST(UnrealSubsurface, AlbedoOfTheScatteredTerm) {
  // Opacity 0, AO 1: ∫ lerp(1/2π, 1, 3 c¹²) over the sphere, c = sat(-V·L), whose ∫ c¹² is 2π/13 about any view.
  const double open = 2.0 + 3.0 * 2.0 * pi / 13.0 * (1.0 - 1.0 / (2.0 * pi));
  const Material body = scatterer("unreal_subsurface", {{"subsurface_color", 1.0}, {"opacity", 0.0}});
  for (const double theta : {0.0, 50.0, 85.0}) {
    EXPECT_NEAR(integrated_albedo(body.model(), body.flat(), at(theta, 10.0)), open, 1e-4) << theta;
  }
  EXPECT_NEAR(open, 3.22, 0.005);
  // Opacity 1, view at the normal: ∫ wrap/2π is 1, and in-scatter .1 c¹² takes and gives a little.
  double closed = 1.0;
  for (const auto& [z, weight] : gauss_legendre(64, -1.0, 0.0)) {
    const double wrap = z > -0.5 ? std::pow((z + 0.5) / 1.5, 1.5) * 5.0 / 3.0 / (2.0 * pi) : 0.0;
    closed += 2.0 * pi * weight * 0.1 * std::pow(-z, 12.0) * (1.0 - wrap);
  }
  const Material dense = scatterer("unreal_subsurface", {{"subsurface_color", 1.0}, {"opacity", 1.0}});
  EXPECT_NEAR(integrated_albedo(dense.model(), dense.flat(), {0.0, 0.0, 1.0}), closed, 1e-4);
}

TEST(UnrealTwoSidedFoliage, AlbedoOfTheScatteredTerm) {
  // View at the normal: c = -z behind, 0 in front, where D_GGX(α = .6) is .36/π.
  double sum = 0.0;
  for (const auto& [lower, upper] : {std::pair{-1.0, 0.0}, {0.0, 0.5}}) {
    for (const auto& [z, weight] : gauss_legendre(48, lower, upper)) {
      const double c = std::max(-z, 0.0), d = 0.36 / (pi * square(c * c * (0.36 - 1.0) + 1.0));
      sum += 2.0 * pi * weight * (0.5 - z) / 2.25 * d;
    }
  }
  const Material leaf = scatterer("unreal_two_sided_foliage", {{"subsurface_color", 1.0}});
  EXPECT_NEAR(integrated_albedo(leaf.model(), leaf.flat(), {0.0, 0.0, 1.0}), sum, 1e-4);
  std::printf("a leaf scatters %.4f of the light at the normal view\n", sum);
}

TEST(UnrealSubsurface, TheTermSurvivesTheHorizon) {
  // f grows as 1/|N·L|, f |N·L| does not: the same from both sides, down to the smallest cosines.
  for (const std::string_view name : {"unreal_subsurface", "unreal_two_sided_foliage", "unreal_preintegrated_skin"}) {
    const Material body = scatterer(name, {{"subsurface_color", 1.0}});
    const Direction wo = at(40, 200);
    const double level = term(body, {at(90, 10), wo});
    EXPECT_GT(level, 0.01) << name;
    for (const double z : {1e-3, 1e-6, 1e-12, 1e-30, -1e-30, -1e-12, -1e-6, -1e-3}) {
      const Direction wi{std::sqrt(1.0 - z * z) * std::cos(radians(10)), std::sqrt(1.0 - z * z) * std::sin(radians(10)),
                         z};
      EXPECT_NEAR(term(body, {wi, wo}), level, 3.0 * std::abs(z) + 1e-12) << name << " " << z;
    }
    for (const double value : {body({1.0, 0.0, 0.0}, wo).x, body({1.0, 0.0, -0.0}, wo).x}) {
      EXPECT_TRUE(std::isfinite(value)) << name;
    }
  }
}

// ---- Eye ------------------------------------------------------------------------------------------------------------

TEST(UnrealEye, Values) {
  // Axis (.4, 0, √.84), depth .7 × .5; F is Schlick's without the 2 % rule.
  const Material eye =
      reference_surface("unreal_eye", {{"iris_tilt", 0.4}, {"iris_mask", 0.7}, {"iris_distance", 0.5}});
  expect_rgb(eye(side.wi, side.wo), {0.171275397229139006, 0.120034261338452693, 0.0536969886823490833});
  // Light from 10° below the cornea's horizon still meets the tilted iris.
  expect_rgb(eye(at(100, 0), at(30, 60)), {0.0998816175439046666, 0.0701605112221604572, 0.0311580045917521991});
}

TEST(UnrealEye, TheWhiteIsLambertUnderItsFresnel) {
  const Material white("unreal_eye", {{"iris_mask", 0.0}, {"iris_tilt", 0.5}, {"base_color", 0.8}, {"roughness", 0.3}});
  const Material d("d_ggx", {{"alpha", 0.09}}), vis("vis_smith_joint_approx", {{"alpha", 0.09}});
  const Material f("f_schlick", {{"f0", 0.04}});
  for (const auto& [wi, wo] : random_pairs(200, 99)) {
    const double fresnel = f(wi, wo).x;
    const double expected = fresnel * d(wi, wo).x * vis(wi, wo).x + (1.0 - fresnel) * 0.8 / pi;
    EXPECT_NEAR(white(wi, wo).x, expected, 1e-11 * expected);
    EXPECT_EQ(white({wi.x, wi.y, -wi.z}, wo).x, 0.0);
  }
}

TEST(UnrealEye, AnUntiltedIrisFocusesLightFromAbove) {
  // N·L = 1: power 1, caustic .8 + .4 = 1.2; at 60°: power 6.5, .8 + 1.5/2^6.5 = .81657. F0 = 0.
  const Material iris("unreal_eye", {{"specular", 0.0}, {"base_color", 1.0}, {"iris_distance", 0.0}});
  const Direction normal{0.0, 0.0, 1.0};
  EXPECT_NEAR(pi * iris(normal, normal).x, 1.2, 1e-13);
  const double grazing = std::pow(1.0 - std::cos(radians(30.0)), 5.0), alpha = 0.25;
  const double nh = std::cos(radians(30.0)), d = alpha * alpha / (pi * square(nh * nh * (alpha * alpha - 1.0) + 1.0));
  const double vis = 0.5 / ((0.5 * 1.0) + 1.0 * (0.5 * (1.0 - alpha) + alpha));
  const double expected = (1.0 - grazing) / pi * (0.8 + 0.2 * 7.5 * std::pow(0.5, 6.5)) + grazing * d * vis;
  EXPECT_NEAR(iris(at(60, 0), normal).x, expected, 1e-13);
}

// ---- PreintegratedSkin
// ------------------------------------------------------------------------------------------------

/// ∫ (N'·L)⁺ R dA/∫ R dA over a sphere of radius 1/k in scattering distances, R(c) = (e^-c + e^-c/3)/(8π c). Chords: dA
/// = c dc dψ. The normal at angle γ from N, where c = (2/k) sin(γ/2), has N'·L = cos θ cos γ + sin θ sin γ cos ψ.
double spread_irradiance(double cosine, double k) {
  const double sine = std::sqrt(1.0 - cosine * cosine), end = std::min(2.0 / k, 60.0);
  constexpr int azimuths = 256, panels = 24;
  double light = 0.0, weights = 0.0;
  for (int panel = 0; panel < panels; ++panel) {
    // Finer where the profile is steep.
    const double from = end * square(panel / double(panels)), to = end * square((panel + 1) / double(panels));
    for (const auto& [c, weight] : gauss_legendre(8, from, to)) {
      const double cos_gamma = 1.0 - 0.5 * square(c * k), sin_gamma = std::sqrt(1.0 - square(cos_gamma));
      double mean = 0.0;
      for (int j = 0; j < azimuths; ++j) {
        const double psi = pi * (j + 0.5) / azimuths;
        mean += std::max(cosine * cos_gamma + sine * sin_gamma * std::cos(psi), 0.0) / azimuths;
      }
      const double profile = std::exp(-c) + std::exp(-c / 3.0);
      light += weight * profile * mean;
      weights += weight * profile;
    }
  }
  return light / weights;
}

TEST(UnrealPreintegratedSkin, FitsTheDiffusionOverASphere) {
  double worst = 0.0, worst_sum = 0.0;
  for (const double k : {0.003, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.37, 0.5, 0.7, 0.85, 1.0}) {
    for (int i = -50; i <= 50; ++i) {
      // Closer where the terminator is.
      const double cosine = i * std::abs(i) / 2500.0;
      worst = std::max(worst, std::abs(UnrealSkinIrradiance::evaluate(cosine, k) - spread_irradiance(cosine, k)));
    }
    // Diffusion takes no light away: over the sphere as much as Lambert's, ½ ∫ I dμ = ¼.
    double sum = 0.0;
    for (const auto& [lower, upper] : {std::pair{-1.0, -0.1}, {-0.1, 0.0}, {0.0, 0.1}, {0.1, 1.0}}) {
      for (const auto& [mu, weight] : gauss_legendre(32, lower, upper)) {
        sum += 2.0 * weight * UnrealSkinIrradiance::evaluate(mu, k);
      }
    }
    worst_sum = std::max(worst_sum, std::abs(sum - 1.0));
  }
  std::printf("skin irradiance: off by at most %.2e; its mean by %.2e of itself\n", worst, worst_sum);
  EXPECT_LT(worst, 1.2e-3);
  EXPECT_LT(worst_sum, 4e-3);
}

TEST(UnrealPreintegratedSkin, FlatSkinIsLambert) {
  const Material skin = scatterer("unreal_preintegrated_skin", {{"subsurface_color", 0.8}, {"opacity", 1.0}});
  for (const auto& [wi, wo] : random_pairs(200, 100)) {
    EXPECT_NEAR(skin(wi, wo).x, 0.8 / pi, 1e-14);
    EXPECT_NEAR(skin({wi.x, wi.y, -wi.z}, wo).x, 0.0, 1e-14);
  }
}

TEST(UnrealPreintegratedSkin, RedGoesFurthestPastTheTerminator) {
  const Material skin = scatterer("unreal_preintegrated_skin", {{"subsurface_color", 1.0}, {"opacity", 0.7}});
  const Rgb dusk = skin(at(95, 0), at(20, 0));
  EXPECT_GT(dusk.x, 1.5 * dusk.y);
  EXPECT_GT(dusk.y, dusk.z);
  EXPECT_GT(dusk.z, 0.0);
}

// ---- sampling -------------------------------------------------------------------------------------------------------

TEST(UnrealSampling, SamplesFollowTheirPdf) {
  int tested = 0;
  for (const Model& model : models()) {
    if (!model.info->name.starts_with("unreal_")) continue;
    ParameterValues values = model.defaults();
    values.set("roughness", 0.6);
    if (values.has("clear_coat_roughness")) values.set("clear_coat_roughness", 0.5);
    if (values.has("anisotropy")) values.set("anisotropy", 0.4);
    if (values.has("iris_tilt")) values.set("iris_tilt", 0.3);
    for (const double theta : {0.0, 50.0, 80.0}) expect_samples_follow_pdf(model, values.flat(), at(theta, 20.0));
    // The same integral by samples and by quadrature.
    EXPECT_NEAR(sampled_albedo(model, values.flat(), at(50.0, 20.0), 300),
                integrated_albedo(model, values.flat(), at(50.0, 20.0)), 3e-3)
        << model.info->name;
    ++tested;
  }
  EXPECT_EQ(tested, 8);
}

// ---- float ----------------------------------------------------------------------------------------------------------

TEST(WholeModelsInFloat, HoldInsideSharpLobes) {
  // 1e-5 relative plus 1e-6 absolute, no allowance for conditioning. Half vectors within six alphas of the normal; both
  // sides see the same rounded inputs.
  for (const Model& model : models()) {
    const std::string name(model.info->name);
    if (name != "disney" && !name.starts_with("unreal_")) continue;
    double relative = 0.0;
    for (const double alpha : {0.002, 0.005, 0.02, 0.1, 0.5}) {
      ParameterValues values = model.defaults();
      values.set("roughness", static_cast<float>(std::sqrt(alpha)));
      for (const char* parameter : {"clear_coat_roughness", "clearcoat", "anisotropic", "anisotropy", "iris_tilt"}) {
        if (values.has(parameter)) values.set(parameter, 0.5);
      }
      UniformNumbers uniform(101);
      FloatPairs pairs(4096);
      for (std::size_t i = 0; i < 4096; ++i) {
        Direction wi{0.0, 0.0, -1.0}, wo;
        while (wi.z < 1e-3) {
          wo = direction(std::acos(uniform.between(0.02, 1.0)), 2.0 * pi * uniform());
          const double slope = 6.0 * alpha * uniform(), turn = 2.0 * pi * uniform();
          wi = reflect(wo, normalize(Direction{slope * std::cos(turn), slope * std::sin(turn), 1.0}));
        }
        pairs.set(i, wi, wo);
      }
      const std::vector<float> float_flat(values.flat().begin(), values.flat().end());
      const std::vector<double> flat(float_flat.begin(), float_flat.end());
      FloatRgb found(4096);
      find_float_model(name).evaluate(float_flat, pairs, 0, 4096, found);
      for (std::size_t i = 0; i < 4096; ++i) {
        const double truth = model.evaluate(flat, pairs.wi(i), pairs.wo(i)).x, error = std::abs(found.r[i] - truth);
        EXPECT_LE(error, 1e-5 * truth + 1e-6) << name << " at alpha " << alpha;
        relative = std::max(relative, error / truth);
      }
    }
    std::printf("%-26s largest relative error in sharp lobes %.2g\n", name.c_str(), relative);
  }
}

}  // namespace
}  // namespace lobefit
