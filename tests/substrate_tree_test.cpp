// Substrate trees: their algebra, walk and closures, their JSON, what they are as matter, and the shipped ones.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <filesystem>
#include <functional>
#include <set>

#include "models/microfacet/fresnel.h"
#include "models/substrate/blend.h"
#include "models/substrate/conversions.h"
#include "models/substrate/simplify.h"
#include "reference/estimate.h"
#include "reference/layered/adding_doubling.h"
#include "reference/output_file.h"
#include "reference/substrate/physical_surface.h"
#include "reference/substrate/tree_albedo.h"
#include "reference/substrate/tree_json.h"
#include "reference/substrate/unreal_slabs.h"
#include "report/tree_figure.h"
#include "tests/directions.h"
#include "tests/gauss_legendre.h"
#include "tests/replicates.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

const fs::path data_folder = LOBEFIT_DATA_FOLDER;

SlabTree tree_of(const std::string& text) {
  const Json json = parse_json(text, "tree");
  return tree_from_json(JsonReader(json, "tree"));
}

std::vector<fs::path> shipped_trees() {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(data_folder / "substrate")) paths.push_back(entry.path());
  std::ranges::sort(paths);
  return paths;
}

void expect_near(const Rgb& a, const Rgb& b, double tolerance, const std::string& what = "") {
  EXPECT_NEAR(a.x, b.x, tolerance) << what;
  EXPECT_NEAR(a.y, b.y, tolerance) << what;
  EXPECT_NEAR(a.z, b.z, tolerance) << what;
}

// ---- slabs of the tests
// ----------------------------------------------------------------------------------------------

/// A medium without interface that lets this much through 1 cm and scatters nothing.
SlabValues filter(const Rgb& transmittance) {
  SlabValues slab = default_slab();
  slab.f0 = slab.diffuse_albedo = {0.0, 0.0, 0.0};
  slab.thickness = 1.0;
  slab.mean_free_path = {-1.0 / std::log(transmittance.x), -1.0 / std::log(transmittance.y),
                         -1.0 / std::log(transmittance.z)};
  return slab;
}
SlabValues grey_filter(double transmittance) { return filter({transmittance, transmittance, transmittance}); }

SlabValues lambert(const Rgb& albedo) {
  SlabValues slab = default_slab();
  slab.f0 = {0.0, 0.0, 0.0};
  slab.diffuse_albedo = albedo;
  slab.diffuse_model = 2.0;
  return slab;
}

SlabValues paint() {
  SlabValues slab = default_slab();
  slab.diffuse_albedo = {0.6, 0.3, 0.1};
  slab.roughness = 0.4;
  return slab;
}

SlabValues tinted_coat(double roughness = 0.3) {
  SlabValues slab = filter({0.9, 0.6, 0.3});
  slab.f0 = {0.04, 0.04, 0.04};
  slab.roughness = roughness;
  return slab;
}

SlabTree covered(const SlabValues& top, double coverage, const SlabValues& bottom) {
  SlabTree tree;
  const int a = tree.add_slab(top), b = tree.add_slab(bottom);
  tree.root = tree.add_vertical(tree.add_coverage(a, coverage), b, -1.0);
  return tree;
}

SlabTree layers(const SlabValues& top, const SlabValues& bottom, double thickness = -1.0) {
  SlabTree tree;
  const int a = tree.add_slab(top), b = tree.add_slab(bottom);
  tree.root = tree.add_vertical(a, b, thickness);
  return tree;
}

SlabTree mix_of(const SlabValues& background, const SlabValues& foreground, double mix) {
  SlabTree tree;
  const int a = tree.add_slab(background), b = tree.add_slab(foreground);
  tree.root = tree.add_horizontal(a, b, mix);
  return tree;
}

/// The BRDF of one slab alone.
Rgb alone(const SlabValues& slab, const DirectionPair& pair) {
  return evaluate_brdf<Slab, double>(slab, pair.wi, pair.wo);
}

/// Of the closures of the lowest slab alone. (A black medium scatters 6e-6 by the published albedo inversion.)
Rgb evaluate_lowest(const std::vector<Closure>& closures, const DirectionPair& pair) {
  Rgb sum{0.0, 0.0, 0.0};
  for (const Closure& closure : closures) {
    if (closure.leaf == closures.back().leaf) sum = sum + closure.evaluate(pair.wi, pair.wo);
  }
  return sum;
}

VirtualSlab grey_slab(double coverage, double transmittance) {
  return {.coverage = coverage, .transmittance = {transmittance, transmittance, transmittance}};
}

// ---- the algebra
// -----------------------------------------------------------------------------------------------------

// What a coat or a mix of nothing or of everything leaves is the other slab, or both of them.
TEST(SubstrateAlgebra, CoverageAndMixOfNoneAndAll) {
  const SlabValues coat = tinted_coat(), base = paint();
  const std::vector<Closure> none = walk(covered(coat, 0.0, base)), all = walk(covered(coat, 1.0, base)),
                             plain = walk(layers(coat, base)), background = walk(mix_of(coat, base, 0.0)),
                             foreground = walk(mix_of(coat, base, 1.0));
  EXPECT_EQ(none.size(), 1u);
  EXPECT_EQ(all.size(), 2u);
  EXPECT_EQ(background.size(), 1u);
  EXPECT_EQ(foreground.size(), 1u);
  SlabValues opaque_coat = coat;  // as the lowest slab
  opaque_coat.mean_free_path = {0.0, 0.0, 0.0};
  for (const DirectionPair& pair : random_pairs(50, 1)) {
    const Rgb base_alone = alone(base, pair), scale = base_alone + 1.0;
    expect_near(evaluate(none, pair.wi, pair.wo), base_alone, 1e-13 * scale.x, "coverage 0");
    expect_near(evaluate(all, pair.wi, pair.wo), evaluate(plain, pair.wi, pair.wo), 1e-13 * scale.x, "coverage 1");
    expect_near(evaluate(background, pair.wi, pair.wo), alone(opaque_coat, pair), 1e-13 * scale.x, "mix 0");
    expect_near(evaluate(foreground, pair.wi, pair.wo), base_alone, 1e-13 * scale.x, "mix 1");
  }
}

TEST(SubstrateAlgebra, AMixIsTheSumOfItsParts) {
  const SlabValues a = lambert({0.8, 0.2, 0.1}), b = paint();
  const std::vector<Closure> mixed = walk(mix_of(a, b, 0.3));
  for (const DirectionPair& pair : random_pairs(50, 2)) {
    expect_near(evaluate(mixed, pair.wi, pair.wo), alone(a, pair) * 0.7 + alone(b, pair) * 0.3, 1e-13);
  }
}

// Coverages are independent, so light passes a stack with the product of 1 - C + C T: hence C = 1 - Π(1 - C) and
// T = (Π(1 - C + C T) - Π(1 - C))/C, in whatever order operators are nested.
TEST(SubstrateAlgebra, LayeringIsAssociative) {
  UniformNumbers uniform(3);
  for (int trial = 0; trial < 200; ++trial) {
    std::array<VirtualSlab, 3> slab;
    double absent = 1.0, passes = 1.0, f0_passes = 1.0;
    for (VirtualSlab& s : slab) {
      s = grey_slab(uniform.between(0.05, 1.0), uniform());
      s.f0 = {uniform(), 0.0, 0.0};
      absent *= 1.0 - s.coverage;
      passes *= 1.0 - s.coverage + s.coverage * s.transmittance.x;
      f0_passes *= 1.0 - s.coverage * s.f0.x;
    }
    for (const VirtualSlab& all :
         {layered(layered(slab[0], slab[1]), slab[2]), layered(slab[0], layered(slab[1], slab[2]))}) {
      EXPECT_NEAR(all.coverage, 1.0 - absent, 1e-14);
      EXPECT_NEAR(all.transmittance.x, (passes - absent) / (1.0 - absent), 1e-13);
      EXPECT_NEAR(all.f0.x * all.coverage, 1.0 - f0_passes, 1e-13);
    }
  }
}

// As the slides print it, a vertical operator gives the sum over what is covered, T C, for the transmittance. Nested,
// that depends on the order. By hand: slabs of C = .6, .3, .8 and T = .5, .2, .7.
TEST(SubstrateAlgebra, ThePrintedSumIsNotAssociative) {
  struct Printed {
    double c, t;
    Printed over(const Printed& b) const {
      return {c + b.c * (1.0 - c), t * c * (1.0 - b.c) + b.t * b.c * (1.0 - c) + t * b.t * b.c * c};
    }
  };
  const Printed p{.6, .5}, q{.3, .2}, r{.8, .7};
  EXPECT_NEAR(p.over(q).over(r).t, .295, 5e-4);
  EXPECT_NEAR(p.over(q.over(r)).t, .305, 5.1e-4);
  const VirtualSlab a = grey_slab(.6, .5), b = grey_slab(.3, .2), c = grey_slab(.8, .7);
  EXPECT_NEAR(layered(layered(a, b), c).transmittance.x, .369, 5e-4);
  EXPECT_NEAR(layered(a, layered(b, c)).transmittance.x, .369, 5e-4);
  // (.4 + .6 .5)(.7 + .3 .2)(.2 + .8 .7) = .40432, less .4 .7 .2 = .056, over .944.
  EXPECT_NEAR(layered(a, layered(b, c)).transmittance.x, .34832 / .944, 1e-13);
}

TEST(SubstrateAlgebra, MixesWeighWhatIsThere) {
  // C = .25 .8 + .75 .4 = .5; T = (.2 .9 + .3 .1)/.5.
  const VirtualSlab mixed_slab = mixed(grey_slab(.4, .1), grey_slab(.8, .9), .25);
  EXPECT_NEAR(mixed_slab.coverage, .5, 1e-15);
  EXPECT_NEAR(mixed_slab.transmittance.x, .42, 1e-15);
  const VirtualSlab weighted_slab = weighted(grey_slab(.8, .9), .5);
  EXPECT_NEAR(weighted_slab.coverage, .4, 1e-15);
  EXPECT_EQ(weighted_slab.transmittance.x, .9);
}

// With C = ½ and T = ¼, ½ + ½ ¼ of every light passes, and of the view as well; at a cosine of ½, ½ + ½ ¼².
TEST(SubstrateAlgebra, TopTransmittanceCountsWhatIsUncovered) {
  const Rgb albedo{0.8, 0.5, 0.2};
  const std::vector<Closure> closures = walk(covered(grey_filter(.25), .5, lambert(albedo)));
  ASSERT_EQ(closures.size(), 2u);
  EXPECT_NEAR(closures[1].light_above.passes_medium(1.0).y, .625, 1e-14);
  EXPECT_NEAR(closures[1].light_above.passes_medium(0.5).y, .53125, 1e-14);
  EXPECT_NEAR(closures[1].view_throughput(1.0).y, .625, 1e-14);
  const Direction normal{0.0, 0.0, 1.0}, slanted = direction(radians(60.0), 1.0);
  expect_near(evaluate_lowest(closures, {slanted, normal}), albedo * (.625 * .53125 / pi), 1e-14);
}

// A coat of no thickness keeps its interface: at the normal, D V F = F0/(4 π α²) with Turquin's 1 + F0 (1 - E)/E, E
// within 2e-3 of 1 at this roughness; and light that comes back from below passes the interface.
TEST(SubstrateAlgebra, ThicknessZeroLeavesTheSpecular) {
  const double roughness = 0.2, alpha = roughness * roughness;
  const SlabTree tree = layers(tinted_coat(roughness), lambert({0.5, 0.5, 0.5}), 0.0);
  const std::vector<Closure> closures = walk(tree);
  ASSERT_EQ(closures.size(), 2u);
  const Direction normal{0.0, 0.0, 1.0};
  const double lobe = 0.04 / (4.0 * pi * alpha * alpha);
  expect_near(closures[0].evaluate(normal, normal), {lobe, lobe, lobe}, 2e-3 * lobe);
  const double below = 0.5 / pi * (1.0 - 0.04);
  expect_near(closures[1].evaluate(normal, normal), {below, below, below}, 2e-3 * below);
  // Off the mirror direction all that is left is the lobe's tail, D F/(4 cos θ) = .00297 .0408 .97/(4 .174), where a
  // medium's own light was.
  const Direction side = direction(radians(80.0), 0.0);
  SlabValues milky = tinted_coat(roughness);
  milky.diffuse_albedo = {0.8, 0.8, 0.8};
  EXPECT_NEAR(closures[0].evaluate(side, normal).y, 1.7e-4, 1e-5);
  EXPECT_NEAR(walk(layers(milky, paint(), 0.0))[0].evaluate(side, normal).y, 1.7e-4, 1e-5);
  EXPECT_GT(walk(layers(milky, paint()))[0].evaluate(side, normal).y, 1e-2);
  // Of the coat's tint neither.
  const Rgb tinted = walk(layers(tinted_coat(roughness), lambert({0.5, 0.5, 0.5})))[1].evaluate(normal, normal);
  expect_near(tinted, Rgb{0.81, 0.36, 0.09} * below, 2e-3 * below);
}

TEST(SubstrateAlgebra, SelectionsTakeOneSide) {
  const std::string a = R"({"slab":{"name":"a"}})", b = R"({"slab":{"name":"b"}})";
  for (const auto& [mask, name] : {std::pair{"0", "a"}, {"0.49", "a"}, {"0.5", "b"}, {"1", "b"}}) {
    const auto closures = walk(tree_of(R"({"select":{"a":)" + a + R"(,"b":)" + b + R"(,"mask":)" + mask + "}}"));
    ASSERT_EQ(closures.size(), 1u);
    EXPECT_EQ(closures[0].name, name);
    EXPECT_EQ(closures[0].weight, 1.0);
  }
}

TEST(SubstrateAlgebra, ClosuresOfNoWeightAreDropped) {
  // Under an opaque slab nothing is seen.
  EXPECT_EQ(walk(layers(paint(), lambert({1.0, 1.0, 1.0}))).size(), 1u);
  EXPECT_EQ(walk(covered(tinted_coat(), 1e-9, paint())).size(), 1u);
}

TEST(SubstrateAlgebra, NodesInsideThemselvesAreRefused) {
  SlabTree tree;
  tree.root = tree.add_coverage(0, 0.5);
  EXPECT_THROW(resolved(tree), std::invalid_argument);
}

// ---- exact statistics
// --------------------------------------------------------------------------------------------------

// One layer that is there everywhere is its own statistics.
TEST(SubstrateStatistics, OneFullLayerIsExact) {
  const SlabTree tree = layers(tinted_coat(), paint());
  const auto virtual_slab = walk(tree), exact = walk(tree, {.exact_statistics = true});
  ASSERT_EQ(exact.size(), 2u);
  for (const DirectionPair& pair : random_pairs(50, 4)) {
    const Rgb truth = evaluate(exact, pair.wi, pair.wo);
    expect_near(evaluate(virtual_slab, pair.wi, pair.wo), truth, 1e-12 * (1.0 + truth.x));
  }
}

// Under a layer of coverage C, events leave C T_v T_l + 1 - C of the light, one virtual slab (1 - C + C T_v)(1 - C + C
// T_l): it loses C (1 - C)(1 - T_v)(1 - T_l).
TEST(SubstrateStatistics, APartialLayerLosesTheCorrelationOfViewAndLight) {
  const double coverage = 0.4, t = 0.3, albedo = 0.7;
  const SlabTree tree = covered(grey_filter(t), coverage, lambert({albedo, albedo, albedo}));
  const auto virtual_slab = walk(tree), exact = walk(tree, {.exact_statistics = true});
  for (const DirectionPair& pair : random_pairs(50, 5)) {
    const double view = std::pow(t, 1.0 / pair.wo.z), light = std::pow(t, 1.0 / pair.wi.z), f = albedo / pi;
    const double truth = f * (coverage * view * light + 1.0 - coverage);
    EXPECT_NEAR(evaluate_lowest(exact, pair).y, truth, 1e-13);
    EXPECT_NEAR(evaluate_lowest(virtual_slab, pair).y,
                truth - f * coverage * (1.0 - coverage) * (1.0 - view) * (1.0 - light), 1e-13);
  }
}

/// Slide 55: slabs 0 (partly) and 1 side by side, over 2 (partly), over 3.
SlabTree slide_55(const std::array<SlabValues, 4>& slabs, double mix, double coverage_0, double coverage_2) {
  SlabTree tree;
  std::array<int, 4> leaf;
  for (std::size_t i = 0; i < 4; ++i) leaf[i] = tree.add_slab(slabs[i], std::to_string(i));
  const int top = tree.add_horizontal(tree.add_coverage(leaf[0], coverage_0), leaf[1], mix);
  tree.root = tree.add_vertical(top, tree.add_vertical(tree.add_coverage(leaf[2], coverage_2), leaf[3], -1.0), -1.0);
  return tree;
}

TEST(SubstrateStatistics, SlabThreeOfSlide55HasSixClosures) {
  const double mix = 0.45, c0 = 0.6, c2 = 0.3;
  const Rgb t0{0.9, 0.5, 0.3}, t1{0.4, 0.7, 0.9}, t2{0.7, 0.8, 0.4}, white{1.0, 1.0, 1.0};
  const SlabTree tree = slide_55({filter(t0), filter(t1), filter(t2), lambert({0.6, 0.5, 0.4})}, mix, c0, c2);
  const std::vector<Closure> exact = walk(tree, {.exact_statistics = true}), few = walk(tree);
  EXPECT_EQ(few.size(), 4u);
  // Events of slab 3 and what passes along the normal: {0, 2}, {0}, {2}, none, {1, 2}, {1}.
  const std::vector<std::pair<double, Rgb>> events{{(1.0 - mix) * c0 * c2, t0 * t2},
                                                   {(1.0 - mix) * c0 * (1.0 - c2), t0},
                                                   {(1.0 - mix) * (1.0 - c0) * c2, t2},
                                                   {(1.0 - mix) * (1.0 - c0) * (1.0 - c2), white},
                                                   {mix * c2, t1 * t2},
                                                   {mix * (1.0 - c2), t1}};
  std::vector<Closure> third;
  for (const Closure& closure : exact) {
    if (closure.name == "3") third.push_back(closure);
  }
  ASSERT_EQ(third.size(), 6u);
  double probability = 0.0;
  Rgb mean{0.0, 0.0, 0.0};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(third[i].weight, events[i].first, 1e-14);
    expect_near(third[i].view_throughput(1.0), events[i].second * events[i].first, 1e-14);
    probability += third[i].weight;
    mean = mean + events[i].second * events[i].first;
  }
  EXPECT_NEAR(probability, 1.0, 1e-14);
  // Along the normal the mean over the events is what one virtual slab passes.
  expect_near(few[3].view_throughput(1.0), mean, 1e-14);
  const SlabTree walked = resolved(tree);
  double all = 0.0;
  for (const SlabEvent& event : slab_events(walked, walked.root)) all += event.probability;
  EXPECT_NEAR(all, 1.0, 1e-14);
  // The shipped example has this topology.
  const std::vector<Closure> shipped =
      walk(read_tree(data_folder / "substrate" / "slide_closures.json"), {.exact_statistics = true});
  EXPECT_EQ(std::ranges::count_if(shipped, [](const Closure& closure) { return closure.name == "3"; }), 6);
}

// ---- closed forms of blend.h
// -------------------------------------------------------------------------------------------

TEST(SubstrateBlend, DiffuseFresnelIsAsPublishedAndAsIntegrated) {
  const struct {
    double index, outside, inside;
  } cases[] = {{1.3, .0611, .4445}, {1.4, .0768, .5290}, {1.5, .0918, .5963}, {1.6, .1063, .6509}};
  for (const auto& [index, outside, inside] : cases) {
    // Of the published figures the last digit is not always rounded: .1063 is .106246.
    EXPECT_NEAR(diffuse_fresnel_outside(index), outside, 6e-5);
    EXPECT_NEAR(diffuse_fresnel_inside(index), inside, 5e-5);
    double sum = 0.0;
    for (const auto& [cosine, weight] : gauss_legendre(200, 0.0, 1.0)) {
      sum += weight * 2.0 * cosine * DielectricFresnel::evaluate(cosine, index);
    }
    EXPECT_NEAR(diffuse_fresnel_outside(index), sum, 1e-6);
  }
  EXPECT_EQ(diffuse_fresnel_outside(1.0), 0.0);
  EXPECT_EQ(diffuse_fresnel_inside(1.0), 0.0);
}

// Kubelka and Munk's R and T: S/(1 + S) and 1/(1 + S) without absorption, 0 and e^-K without scattering, in between
// sinh(b S)/(a sinh + b cosh) and b/(a sinh + b cosh) with a = 1 + K/S, b = √(a² - 1), and R∞ = a - b in the end. A
// constant 1e-8 keeps the root differentiable, which costs 1e-4 of it.
TEST(SubstrateBlend, KubelkaMunk) {
  for (const double s : {0.1, 1.0, 5.0}) {
    const auto white = TwoStreams<double>::of(0.0, s);
    EXPECT_NEAR(white.reflected, s / (1.0 + s), 1e-6);
    EXPECT_NEAR(white.passed, 1.0 / (1.0 + s), 1e-6);
    const auto black = TwoStreams<double>::of(s, 0.0);
    EXPECT_EQ(black.reflected, 0.0);
    EXPECT_NEAR(black.passed, std::exp(-s), 1e-6);
    for (const double k : {0.05, 0.5, 2.0}) {
      const double a = 1.0 + k / s, b = std::sqrt(a * a - 1.0);
      const double scale = a * std::sinh(b * s) + b * std::cosh(b * s);
      const auto grey = TwoStreams<double>::of(k, s);
      EXPECT_NEAR(grey.reflected, std::sinh(b * s) / scale, 1e-6);
      EXPECT_NEAR(grey.passed, b / scale, 1e-6);
      EXPECT_NEAR(TwoStreams<double>::of(400.0 * k, 400.0 * s).reflected, a - b, 1e-9);
      // Two halves are the whole, and the whole over a bottom is the half over the half over the bottom.
      const auto half = TwoStreams<double>::of(0.5 * k, 0.5 * s);
      EXPECT_NEAR(grey.over(0.7), half.over(half.over(0.7)), 1e-6);
    }
  }
}

/// Face-on directional albedo of one slab: the mean over lobes' samples.
double face_on(const std::vector<Closure>& closures) {
  return directional_albedo(closures, direction(radians(0.5), 0.0), 48).y;
}
double face_on(const SlabValues& slab) {
  SlabTree tree;
  tree.root = tree.add_slab(slab);
  return face_on(walk(tree));
}

// Saunderson by hand, n = 1.5 over ρ = ½: .04 + .96 (1 - .5963) ½/(1 - .5963 ½) = .316. The tree knows no inside of an
// interface, and counts the outside for the view: .04 + .96 ½ = .52. Its baseline collapse has another interface, which
// is nearly as rough as the base and so returns .04 times E = .93, over .96 ½: .0372 + .9628 .48 = .499.
TEST(SubstrateBlend, SmoothCoatOverHalfWhite) {
  const double saunderson = .04 + .96 * (1.0 - .5963) * .5 / (1.0 - .5963 * .5);
  EXPECT_NEAR(saunderson, .316, 5e-4);
  SlabValues coat = grey_filter(0.999999);
  coat.f0 = {.04, .04, .04};
  coat.roughness = 0.1;
  const SlabValues base = lambert({.5, .5, .5});
  EXPECT_NEAR(face_on(walk(layers(coat, base))), .52, .001);
  EXPECT_NEAR(face_on(BaselineBlend::vertical(coat, base)), .4993, .001);
  EXPECT_NEAR(face_on(FittedBlend::vertical(coat, base, 1.0, FittedBlend::initial())), saunderson, .02 * saunderson);
}

// ---- JSON
// ------------------------------------------------------------------------------------------------------------

std::string slab(const std::string& members) { return R"({"slab":{)" + members + "}}"; }

TEST(SubstrateJson, SaysWhatIsWrongAndWhere) {
  const std::string plain = slab("");
  const std::string nine = [&] {
    std::string text = plain;
    for (int i = 0; i < 8; ++i)
      text = R"({"vertical":{"top":)" + slab("\"mean_free_path\":1") + R"(,"bottom":)" + text + "}}";
    return text;
  }();
  const std::string deep = [&] {
    std::string text = plain;
    for (int i = 0; i < 2000; ++i) text = R"({"coverage":{"weight":1,"operand":)" + text + "}}";
    return text;
  }();
  /// 30 lines that name 2^30 slabs.
  const auto explosion = [&](const std::string& kind, const std::string& amount, const std::string& a,
                             const std::string& b) {
    std::string text = R"({"root":"n30","nodes":{"n0":)" + plain;
    for (int i = 1; i <= 30; ++i) {
      const std::string below = "\"n" + std::to_string(i - 1) + "\"";
      text += ",\"n" + std::to_string(i) + "\":{\"" + kind + "\":{\"" + a + "\":" + below + ",\"" + b + "\":" + below +
              ",\"" + amount + "\":0.5}}";
    }
    return text + "}}";
  };
  const struct {
    std::string text, path, what;
  } cases[] = {
      // Structure.
      {"[]", "$", "expected an object"},
      {"{}", "$", "got 0 of them"},
      {R"({"slab":{},"coverage":{"operand":)" + plain + R"(,"weight":1}})", "$", "got 2 of them"},
      {R"({"root":)" + plain + R"(,"slab":{}})", "$", "'root' beside a node"},
      {R"({"vertcal":{}})", "$", "did you mean 'vertical'"},
      {R"({"slab":{},"titel":"x"})", "$", "did you mean 'title'"},
      {R"({"slab":{},"title":3})", "$.title", "expected a text"},
      {R"({"slab":{},"thin":1})", "$.thin", "expected true or false"},
      {R"({"coverage":{"operand":{"title":"x","slab":{}},"weight":1}})", "$.coverage.operand", "unknown key 'title'"},
      {R"({"coverage":{"operand":7,"weight":1}})", "$.coverage.operand", "expected an object"},
      {R"({"slab":{},"nodes":[]})", "$.nodes", "expected an object"},
      // Operators.
      {R"({"vertical":{"top":)" + plain + "}}", "$.vertical", "a vertical operator over nothing"},
      {R"({"vertical":{"top":)" + plain + R"(,"bottom":null}})", "$.vertical", "a vertical operator over nothing"},
      {R"({"vertical":{"bottom":)" + plain + "}}", "$.vertical", "missing operand 'top'"},
      {R"({"vertical":{"top":)" + plain + R"(,"botom":)" + plain + "}}", "$.vertical", "did you mean 'bottom'"},
      {R"({"vertical":{"top":)" + plain + R"(,"bottom":)" + plain + R"(,"thickness":-1}})", "$.vertical.thickness",
       "-1 is out of range"},
      {R"({"horizontal":{"background":)" + plain + R"(,"mix":0.5}})", "$.horizontal", "missing operand 'foreground'"},
      {R"({"horizontal":{"background":)" + plain + R"(,"foreground":)" + plain + "}}", "$.horizontal", "missing 'mix'"},
      {R"({"horizontal":{"background":)" + plain + R"(,"foreground":)" + plain + R"(,"mix":1.5}})", "$.horizontal.mix",
       "1.5 is out of range"},
      {R"({"horizontal":{"background":)" + plain + R"(,"foreground":)" + plain + R"(,"mix":"half"}})",
       "$.horizontal.mix", "expected a number"},
      {R"({"coverage":{"operand":)" + plain + R"(,"weight":-0.1}})", "$.coverage.weight", "-0.1 is out of range"},
      {R"({"coverage":{"weight":0.1}})", "$.coverage", "missing operand 'operand'"},
      {R"({"select":{"a":)" + plain + R"(,"b":)" + plain + R"(,"mask":2}})", "$.select.mask", "2 is out of range"},
      {R"({"select":{"a":)" + plain + R"(,"mask":1}})", "$.select", "missing operand 'b'"},
      // Slabs.
      {R"({"slab":3})", "$.slab", "expected an object"},
      {slab(R"("rougness":0.5)"), "$.slab", "did you mean 'roughness'"},
      {slab(R"("name":3)"), "$.slab.name", "expected a text"},
      {slab(R"("roughness":"smooth")"), "$.slab.roughness", "expected a number"},
      {slab(R"("roughness":1.1)"), "$.slab.roughness", "1.1 is out of range"},
      {slab(R"("mean_free_path":[1,-1,1])"), "$.slab.mean_free_path[1]", "-1 is out of range"},
      {slab(R"("mean_free_path":-2)"), "$.slab.mean_free_path", "-2 is out of range"},
      {slab(R"("thickness":-2)"), "$.slab.thickness", "-2 is out of range"},
      {slab(R"("diffuse_albedo":[1,1])"), "$.slab.diffuse_albedo", "expected one number or three"},
      {slab(R"("diffuse_albedo":[1,1,2])"), "$.slab.diffuse_albedo[2]", "2 is out of range"},
      {slab(R"("phase_anisotropy":1)"), "$.slab.phase_anisotropy", "1 is out of range"},
      {slab(R"("diffuse_model":"phong")"), "$.slab.diffuse_model", "chan, eon, lambert"},
      {slab(R"("ior":0.5)"), "$.slab.ior", "0.5 is out of range"},
      {slab(R"("ior":1.5,"f0":0.04)"), "$.slab", "'ior' and 'f0' together"},
      {slab(R"("base_color":1,"diffuse_albedo":1)"), "$.slab", "'base_color' and 'diffuse_albedo' together"},
      {slab(R"("transmittance":1,"mean_free_path":1)"), "$.slab", "'transmittance' and 'mean_free_path' together"},
      {slab(R"("haziness":1,"second_roughness":1)"), "$.slab", "'haziness' and 'second_roughness' together"},
      {slab(R"("metallic":1)"), "$.slab", "without base_color"},
      {slab(R"("haze_extent":1)"), "$.slab", "without haziness"},
      {slab(R"("base_color":1,"metallic":2)"), "$.slab.metallic", "2 is out of range"},
      {slab(R"("specular_tint":0.5)"), "$.slab", "unknown key 'specular_tint'"},
      {slab(R"("specular_profile":{})"), "$.slab.specular_profile", "an empty profile"},
      {slab(R"("specular_profile":{"tabel":[[1]]})"), "$.slab.specular_profile", "tabel"},
      {slab(R"("specular_profile":{"table":[]})"), "$.slab.specular_profile.table", "an empty table"},
      {slab(R"("specular_profile":{"table":[[1,1],[1]]})"), "$.slab.specular_profile.table[1]",
       "1 entries where the rows above have 2"},
      {slab(R"("specular_profile":{"table":[[1,[1,2,0]]]})"), "$.slab.specular_profile.table[0][1][1]",
       "2 is out of range"},
      {slab(R"("specular_profile":{"view_ramp":[]})"), "$.slab.specular_profile.view_ramp", "an empty ramp"},
      {slab(R"("specular_profile":{"table":[[1]],"light_ramp":[1]})"), "$.slab.specular_profile",
       "'table' and 'light_ramp' together"},
      {R"({"unreal":{"model":"hair"}})", "$.unreal.model", "default_lit, clear_coat, cloth, subsurface"},
      {R"({"unreal":{"model":"cloth","opacity":1}})", "$.unreal", "unknown key 'opacity'"},
      {R"({"unreal":{"model":"eye","iris_tilt":1}})", "$.unreal.iris_tilt", "1 is out of range"},
      {R"({"unreal":{"roughness":1}})", "$.unreal", "missing 'model'"},
      // Names.
      {R"({"root":"cot","nodes":{"coat":{"slab":{}}}})", "$.root", "did you mean 'coat'"},
      {R"({"root":"coat"})", "$.root", "no node is named 'coat'"},
      {R"({"root":"a","nodes":{"a":{"coverage":{"operand":"b","weight":1}},"b":{"coverage":{"operand":"a","weight":1}}}})",
       "$.nodes.b.coverage.operand", "a cycle: a → b → a"},
      {R"({"root":"a","nodes":{"a":"a"}})", "$.nodes.a", "a cycle: a → a"},
      // Nodes that nothing uses are read as well.
      {R"({"slab":{},"nodes":{"spare":{"slab":{"rougness":1}}}})", "$.nodes.spare.slab", "did you mean 'roughness'"},
      {R"({"slab":{},"nodes":{"a":"b","b":"a"}})", "$.nodes.b", "a cycle: a → b → a"},
      // Sizes.
      {nine, "$", "9 slabs, and at most 8 closures"},
      {deep, "", "more than 100 nodes inside each other"},
      {explosion("horizontal", "mix", "background", "foreground"), "$", "1073741824 slabs, and at most 8 closures"},
      {explosion("select", "mask", "a", "b"), "$", "1073741824 slabs with those that selections leave out"},
  };
  for (const auto& [text, path, what] : cases) {
    try {
      tree_of(text);
      ADD_FAILURE() << "accepted: " << text.substr(0, 200);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::invalid_input);
      const std::string message = error.what();
      EXPECT_NE(message.find(path.empty() ? "(tree, $." : "(tree, " + path + ")"), std::string::npos) << message;
      EXPECT_NE(message.find(what), std::string::npos) << message;
    }
  }
  EXPECT_THROW(read_tree("/nonexistent/tree.json"), Error);
}

TEST(SubstrateJson, EightSlabsAndSharedNodesAreFine) {
  const SlabTree tree = tree_of(
      R"({"root":{"horizontal":{"background":"four","foreground":"four","mix":0.5}},"nodes":{
          "four":{"horizontal":{"background":"two","foreground":"two","mix":0.5}},
          "two":{"horizontal":{"background":"one","foreground":"one","mix":0.5}},"one":{"slab":{}}}})");
  EXPECT_EQ(walk(tree).size(), 8u);
}

// Substrate's helper nodes by hand.
TEST(SubstrateJson, HelpersSetParameters) {
  const SlabTree tree = tree_of(slab(R"("ior":1.5,"transmittance":[0.5,1,0],"thickness":2,"diffuse_albedo":0)"));
  const SlabValues& slab_values = tree.node(tree.root).slab;
  expect_near(slab_values.f0, {0.04, 0.04, 0.04}, 1e-15);
  EXPECT_NEAR(slab_values.mean_free_path.x, 2.0 / std::log(2.0), 1e-13);
  EXPECT_GE(slab_values.mean_free_path.y, 1e5);
  EXPECT_EQ(slab_values.mean_free_path.z, 0.0);
  const SlabTree metal = tree_of(slab(R"("base_color":[1,0.5,0],"metallic":0.75,"specular":1)"));
  expect_near(metal.node(metal.root).slab.diffuse_albedo, {0.25, 0.125, 0.0}, 1e-15);
  expect_near(metal.node(metal.root).slab.f0, {0.77, 0.395, 0.02}, 1e-15);
}

// A Lambertian body under a bare slab's interface is known to the last digit, a lobe by its table: E and Turquin's
// factor, both from elsewhere. 24 steps do it to 2e-3, whatever the shares of the lobes.
TEST(SubstrateAlbedo, IsThatOfItsParts) {
  for (const double roughness : {0.1, 0.35, 0.5, 0.7}) {
    for (const double rho : {0.0, 0.13, 0.5, 0.87}) {
      for (const double theta : {0.5, 45.0, 70.0}) {
        SlabValues slab_values = lambert({rho, rho, rho});
        slab_values.f0 = {0.04, 0.04, 0.04};
        slab_values.roughness = roughness;
        SlabTree tree;
        tree.root = tree.add_slab(slab_values);
        const Direction wo = direction(radians(theta), 0.0);
        const double specular = Slab::specular_albedo(slab_values, wo.z).y;
        EXPECT_NEAR(directional_albedo(walk(tree), wo).y, specular + (1.0 - specular) * rho, 2e-3)
            << roughness << " " << rho << " " << theta;
      }
    }
  }
}

/// Every value and operator of two trees, resolved.
void expect_same(const SlabTree& a, const SlabTree& b, const std::string& name) {
  const SlabTree x = resolved(a), y = resolved(b);
  EXPECT_EQ(x.thin, y.thin) << name;
  ASSERT_EQ(x.nodes.size(), y.nodes.size()) << name;
  for (std::size_t i = 0; i < x.nodes.size(); ++i) {
    const TreeNode &p = x.nodes[i], &q = y.nodes[i];
    EXPECT_EQ(p.kind, q.kind) << name;
    EXPECT_EQ(p.first, q.first) << name;
    EXPECT_EQ(p.second, q.second) << name;
    EXPECT_EQ(p.amount, q.amount) << name;
    EXPECT_EQ(p.name, q.name) << name;
    ASSERT_EQ(p.profile == nullptr, q.profile == nullptr) << name;
    if (p.profile) expect_near(p.profile->tint(0.3, 0.8), q.profile->tint(0.3, 0.8), 1e-15, name);
    SlabValues s = p.slab, t = q.slab;
    std::vector<double> values;
    const auto collect = [&](auto& member, const ParameterInfo&) {
      if constexpr (is_vector<std::remove_cvref_t<decltype(member)>>) {
        values.insert(values.end(), {member.x, member.y, member.z});
      } else {
        values.push_back(member);
      }
    };
    Slab::describe(s, collect);
    const std::vector<double> first = std::exchange(values, {});
    Slab::describe(t, collect);
    EXPECT_EQ(first, values) << name << ", " << p.name;
  }
}

// The schema is written by hand; its keys are held to the program's.
TEST(SubstrateJson, TheSchemaKnowsEverySlabKey) {
  const std::string path = (data_folder / "schemas" / "substrate_tree.json").string();
  const Json schema = parse_json(read_file(path), path);
  const Json& properties = schema.at("$defs").at("slab").at("properties");
  std::set<std::string> written, known{"name",          "ior",      "base_color",  "metallic",        "specular",
                                       "transmittance", "haziness", "haze_extent", "specular_profile"};
  for (const auto& [key, ignored] : properties.items()) written.insert(key);
  for (const ParameterInfo& info : describe_parameters<Slab>()) {
    if (info.name == "specular_tint") continue;  // a profile's value for one pair of directions
    known.insert(std::string(info.name));
    const Json& property = properties.at(std::string(info.name));
    // Colours bound their numbers elsewhere.
    if (property.contains("minimum")) {
      EXPECT_EQ(property.at("minimum"), info.lower) << info.name;
      EXPECT_EQ(property.at("maximum"), info.upper) << info.name;
    }
    if (info.choices.empty()) {
      EXPECT_EQ(property.value("default", 0.5), info.initial) << info.name;
    } else {
      EXPECT_EQ(property.at("enum").size(), info.choices.size());
    }
  }
  EXPECT_EQ(written, known);
}

TEST(SubstrateJson, TheSchemaKnowsUnrealsModels) {
  const std::string path = (data_folder / "schemas" / "substrate_tree.json").string();
  const Json schema = parse_json(read_file(path), path);
  std::map<std::string, std::set<std::string>> written, known;
  for (const Json& model : schema.at("$defs").at("unreal").at("oneOf")) {
    std::set<std::string>& keys = written[model.at("properties").at("model").at("const").get<std::string>()];
    for (const auto& [key, ignored] : model.at("properties").items()) keys.insert(key);
  }
  const auto add = [&]<class M>(const M&) {
    std::set<std::string>& keys = known[std::string(unreal_slab_name<M>)];
    keys.insert("model");
    for (const ParameterInfo& info : describe_parameters<M>()) keys.insert(std::string(info.name));
  };
  std::apply([&](const auto&... models) { (add(models), ...); }, UnrealSlabModels{});
  EXPECT_EQ(written, known);
}

// ---- specular profiles and older models
// --------------------------------------------------------------------------------

// Bilinear tables hold .2 + .3 μ_o + .4 μ_i exactly. What the tint leaves out is the specular part's, which a black
// body shows alone.
TEST(SpecularProfile, TintsTheSpecularPartAlone) {
  const auto tint = [](double o, double i) { return 0.2 + 0.3 * o + 0.4 * i; };
  Json table = Json::array();
  for (const double o : {0.0, 0.5, 1.0}) {
    table.push_back({tint(o, 0.0), tint(o, 1.0 / 3.0), tint(o, 2.0 / 3.0), tint(o, 1.0)});
  }
  const std::string rest = R"("f0":0.3,"roughness":0.4,"second_roughness":0.7,"second_roughness_weight":0.3)";
  const auto with = [&](const std::string& more) {
    return walk(tree_of(R"({"vertical":{"top":{"slab":{"mean_free_path":3,"diffuse_albedo":0}},"bottom":{"slab":{)" +
                        rest + more + "}}}}"));
  };
  const std::vector<Closure> tinted = with(R"(,"specular_profile":{"table":)" + table.dump() + "}"), plain = with(""),
                             specular = with(R"(,"diffuse_albedo":0)");
  ASSERT_EQ(tinted.size(), 2u);
  for (const DirectionPair& pair : random_pairs(100, 12)) {
    const Rgb f = tinted[1].evaluate(pair.wi, pair.wo), lost = specular[1].evaluate(pair.wi, pair.wo);
    expect_near(f, plain[1].evaluate(pair.wi, pair.wo) - lost * (1.0 - tint(pair.wo.z, pair.wi.z)), 1e-12);
  }
}

TEST(SpecularProfile, RampsMultiply) {
  const std::vector<Closure> closures =
      walk(tree_of(R"({"slab":{"specular_profile":{"view_ramp":[0.2,[1,0.5,0]],"light_ramp":[0.4,0.6,1]}}})"));
  ASSERT_TRUE(closures[0].profile);
  expect_near(closures[0].profile->tint(0.25, 0.75), Rgb{0.4, 0.275, 0.15} * 0.8, 1e-14);
  expect_near(closures[0].profile->tint(1.0, 0.0), Rgb{0.4, 0.2, 0.0}, 1e-14);
}

TEST(SpecularProfile, IsMixedByTheLightOfBothLobes) {
  const auto mixed_tint = [](double f0_other) {
    const SlabTree tree =
        tree_of(R"({"horizontal":{"mix":0.25,"background":{"slab":{"f0":)" + std::to_string(f0_other) +
                R"(}},"foreground":{"slab":{"f0":0.3,"specular_profile":{"view_ramp":[0.2]}}}}})");
    const SlabTree one =
        collapsed(collapsible(tree), collapsible_operators(collapsible(tree)).at(0), BlendRule::fitted, {});
    const std::vector<Closure> closures = walk(one);
    EXPECT_EQ(closures.size(), 1u);
    return closures.at(0).profile->tint(0.3, 0.6).y;
  };
  EXPECT_NEAR(mixed_tint(0.3), 0.75 + 0.25 * 0.2, 1e-12);
  EXPECT_NEAR(mixed_tint(0.1), 0.5 + 0.5 * 0.2, 1e-12);
  EXPECT_NEAR(mixed_tint(0.0), 0.2, 1e-12);
}

TEST(SpecularProfile, CostsItsNumberUntilItIsDropped) {
  SlabTree tree = tree_of(R"({"slab":{"specular_profile":{"view_ramp":[0.5,[1,0.5,1]]}}})");
  const std::vector<Closure> with = walk(tree);
  EXPECT_TRUE(stored_features(with)[0].specular_profile);
  EXPECT_TRUE(drop_feature(tree, SlabFeature::specular_profile));
  EXPECT_FALSE(drop_feature(tree, SlabFeature::specular_profile));
  const std::vector<Closure> without = walk(tree);
  EXPECT_FALSE(stored_features(without)[0].specular_profile);
  EXPECT_LT(tree_bytes(without), tree_bytes(with));
  // Face on and in the mirror's direction the light is the same.
  const Direction up{0.0, 0.0, 1.0};
  SlabValues black_with = with[0].slab, black_without = without[0].slab;
  black_with.diffuse_albedo = black_without.diffuse_albedo = {0.0, 0.0, 0.0};
  Closure a = with[0], b = without[0];
  a.slab = black_with;
  b.slab = black_without;
  expect_near(a.evaluate(up, up), b.evaluate(up, up), 0.03 * a.evaluate(up, up).x);
}

// At opacity 0 the term is c ((1 - 3 s¹²)/2π + 3 s¹²), s = sat(-V·L); over the sphere that is 2 - 3/13 + 6π/13.
TEST(UnrealSlabs, ScatteredSharesAddUpToTheTermsIntegral) {
  auto pins = default_parameters<UnrealSubsurface>();
  pins.opacity = 0.0;
  pins.subsurface_color = {0.5, 0.25, 1.0};
  const ScatteredShares shares = scattered_shares<UnrealSubsurface>(pins);
  const double integral = 2.0 - 3.0 / 13.0 + 6.0 * pi / 13.0;
  expect_near(shares.back + shares.through, pins.subsurface_color * integral, 3e-3 * integral);
  EXPECT_GT(shares.through.x, shares.back.x);
}

TEST(UnrealSlabs, LeavesLetThroughWhatTheirTermSends) {
  const SlabTree leaf = tree_of(
      R"({"thin":true,"unreal":{"model":"two_sided_foliage","base_color":[0.1,0.2,0.05],"subsurface_color":0.8}})");
  auto pins = default_parameters<UnrealTwoSidedFoliage>();
  pins.subsurface_color = {0.8, 0.8, 0.8};
  const ScatteredShares shares = scattered_shares<UnrealTwoSidedFoliage>(pins);
  EXPECT_GT(shares.through.x, 0.05);
  expect_near(root_statistics(leaf).transmittance, shares.through, 1e-12);
  const SlabValues slab = leaf.node(leaf.root).slab;
  EXPECT_NEAR(slab.diffuse_albedo.y - slab.diffuse_albedo.x, 0.1, 1e-12);
}

TEST(UnrealSlabs, SkinHasTheProfilesTwoLobes) {
  const SlabTree skin = tree_of(R"({"unreal":{"model":"subsurface_profile","roughness":0.4,"base_color":0.7}})");
  const SlabValues slab = skin.node(skin.root).slab;
  EXPECT_NEAR(slab.roughness, 0.3, 1e-15);
  EXPECT_NEAR(slab.second_roughness, 0.52, 1e-15);
  EXPECT_NEAR(slab.second_roughness_weight, 0.85, 1e-15);
  EXPECT_EQ(slab.diffuse_albedo.x, 0.7);
  EXPECT_NEAR(slab.f0.x, 0.04, 1e-15);
}

// ---- the shipped trees
// -------------------------------------------------------------------------------------------------

TEST(ShippedTrees, AreEnoughAndDescribed) {
  const std::vector<fs::path> paths = shipped_trees();
  EXPECT_GE(paths.size(), 26u);
  std::set<std::string> titles;
  std::map<Operator, int> kinds;
  for (const fs::path& path : paths) {
    const Json json = parse_json(read_file(path), path.string());
    titles.insert(json.at("title").get<std::string>());
    EXPECT_GE(json.at("description").get<std::string>().size(), 40u) << path;
    EXPECT_EQ(json.at("$schema"), "../schemas/substrate_tree.json") << path;
    for (const TreeNode& node : read_tree(path).nodes) ++kinds[node.kind];
  }
  EXPECT_EQ(titles.size(), paths.size());
  EXPECT_EQ(kinds.size(), operator_names.size());
}

TEST(ShippedTrees, AreReadWrittenAndWalked) {
  for (const fs::path& path : shipped_trees()) {
    const std::string name = path.stem().string();
    const SlabTree tree = read_tree(path);
    expect_same(tree, tree_of(tree_json(tree).dump()), name);
    const std::vector<Closure> closures = walk(tree);
    EXPECT_GE(closures.size(), 2u) << name;
    EXPECT_LE(closures.size(), most_closures) << name;
    for (const DirectionPair& pair : random_pairs(100, 6)) {
      const Rgb value = evaluate(closures, pair.wi, pair.wo);
      EXPECT_TRUE(std::isfinite(value.x + value.y + value.z)) << name;
      // Chan's bump may dip below 0, by little.
      EXPECT_GT(min(min(value.x, value.y), value.z), -0.02) << name;
    }
    for (const double theta : {1.0, 30.0, 60.0, 80.0, 88.0}) {
      const Rgb albedo = directional_albedo(closures, direction(radians(theta), 0.4));
      EXPECT_GE(min(min(albedo.x, albedo.y), albedo.z), 0.0) << name << " " << theta;
      EXPECT_LE(largest_channel(albedo), 1.15) << name << " " << theta;
    }
  }
}

TEST(ShippedTrees, AreDrawn) {
  for (const fs::path& path : shipped_trees()) {
    const SlabTree tree = read_tree(path), walked = resolved(tree);
    const std::string text = tree_text(tree), svg = tree_svg(tree, "a < b & c");
    EXPECT_NE(svg.find(">a &lt; b &amp; c</text>"), std::string::npos);
    std::size_t slabs = 0;
    for (const TreeNode& node : walked.nodes) {
      if (node.kind != Operator::slab) continue;
      ++slabs;
      EXPECT_NE(text.find(node.name + ": diffuse"), std::string::npos) << path;
      EXPECT_NE(svg.find(">" + node.name + "</text>"), std::string::npos) << path;
    }
    // A line for every node, what selections leave out included.
    EXPECT_GE(static_cast<std::size_t>(std::ranges::count(text, '\n')), walked.nodes.size()) << path;
    EXPECT_EQ(svg.find("nan"), std::string::npos) << path;

    // Boxes lie apart and inside the picture.
    struct Box {
      double x, y, width, height;
    };
    std::vector<Box> boxes;
    Box picture{0.0, 0.0, 0.0, 0.0};
    ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("viewBox"), "viewBox=\"0 0 %lf %lf", &picture.width, &picture.height),
              2);
    for (std::size_t at = svg.find("<rect x"); at != std::string::npos; at = svg.find("<rect x", at + 1)) {
      Box box;
      ASSERT_EQ(std::sscanf(svg.c_str() + at, "<rect x=\"%lf\" y=\"%lf\" width=\"%lf\" height=\"%lf\"", &box.x, &box.y,
                            &box.width, &box.height),
                4);
      if (box.height > 30.0) boxes.push_back(box);  // not swatches
    }
    EXPECT_GE(boxes.size(), walked.nodes.size()) << path;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      const Box& a = boxes[i];
      EXPECT_TRUE(a.x > 0.0 && a.y > 0.0 && a.x + a.width < picture.width && a.y + a.height < picture.height) << path;
      for (std::size_t j = 0; j < i; ++j) {
        const Box& b = boxes[j];
        EXPECT_TRUE(a.x + a.width < b.x || b.x + b.width < a.x || a.y + a.height < b.y || b.y + b.height < a.y) << path;
      }
    }
  }
}

TEST(TreeText, ShowsTopologyAndStatistics) {
  EXPECT_EQ(tree_text(tree_of(
                R"({"vertical":{"thickness":0.5,"top":{"coverage":{"weight":0.5,"operand":{"slab":{"name":"film",
                    "f0":0,"diffuse_albedo":0,"transmittance":0.25,"thickness":0.5}}}},
                    "bottom":{"select":{"mask":0,"a":{"slab":{"name":"base","anisotropy":0.5}},"b":{"slab":{}}}}}})")),
            "vertical, 0.5 cm  [C 1, T 0]\n"
            "├─ top: coverage 50 %  [C 0.5, T .25]\n"
            "│  └─ operand: film: diffuse 0, F0 0, roughness 0.5, 0.5 cm thick  [C 1, T .25]\n"
            "└─ bottom: select a, mask 0  [C 1, T 0]\n"
            "   ├─ a: base: diffuse .5, F0 .04, roughness 0.5, anisotropy 0.5  [C 1, T 0]\n"
            "   └─ b: slab: diffuse .5, F0 .04, roughness 0.5  [left out]\n");
}

// ---- as matter
// ---------------------------------------------------------------------------------------------------------

// A smooth coat, n = 1.5, over paint of the same index: one interface. Where diffuse albedos are what a slab shows in
// air, ρ below it is ρ_seen/(1 - F_i + F_i ρ_seen) with the published F_i = .5963; else ρ itself. Adding-doubling takes
// such stacks as written. 2 readings, 2 coats, 2 views, 3 channels at 4 standard errors of 31 degrees of freedom: .9 %
// of false alarms under fresh seeds.
TEST(SubstratePhysics, SmoothCoatsAgreeWithAddingDoubling) {
  const Rgb seen{0.7, 0.4, 0.1};
  for (const DiffuseReading reading : {DiffuseReading::in_air, DiffuseReading::bare}) {
    const auto below = [&](double rho) {
      return reading == DiffuseReading::bare ? rho : rho / (1.0 - .5963 + .5963 * rho);
    };
    for (const double mean_free_path : {0.5, 1000.0}) {
      SlabValues coat = default_slab(), base = default_slab();
      coat.diffuse_albedo = {0.0, 0.0, 0.0};
      coat.roughness = 0.0;
      coat.mean_free_path = {mean_free_path, mean_free_path, mean_free_path};
      base.diffuse_albedo = seen;
      const PhysicalSurface surface(layers(coat, base, 0.1), reading);
      const LayerStack stack{
          .layers = {InterfaceLayer{.ior = 1.5},
                     MediumLayer{
                         .mean_free_path = coat.mean_free_path, .albedo = {0.0, 0.0, 0.0}, .g = 0.0, .thickness = 0.1}},
          .bottom = DiffuseLayer{{below(seen.x), below(seen.y), below(seen.z)}}};
      const std::array cosines_i{std::cos(radians(35.0))};
      const std::array cosines_o{std::cos(radians(15.0)), std::cos(radians(65.0))};
      AddingDoublingOptions options;
      options.modes = 1;
      options.streams = 32;
      const AddingDoubling exact(stack, cosines_i, cosines_o, options);
      const Direction wi = direction(std::acos(cosines_i[0]), 2.0);
      for (std::size_t o = 0; o < cosines_o.size(); ++o) {
        const Direction wo = direction(std::acos(cosines_o[o]), 0.3);
        const RgbEstimate estimate = replicates(7, [&](const SamplePoints& points) {
          Rgb value;
          surface.sample_row(wo, {&wi, 1}, points, 4096, false, {.values = {&value, 1}});
          return value;
        });
        const Rgb truth = exact.value(0, o, 0.0);
        const std::array channels{truth.x, truth.y, truth.z};
        for (std::size_t c = 0; c < 3; ++c) {
          const auto& [mean, error] = estimate.channel[c];
          // F_i is published to four digits: 1e-4 of it.
          EXPECT_LT(std::abs(mean - channels[c]), 4.0 * error + 1e-4 * channels[c]) << mean_free_path << " " << c;
          EXPECT_LT(error, 5e-3 * channels[c]);
        }
      }
    }
  }
}

// Face-on and smooth: .04 + .96 (1 - F_i) ρ/(1 - F_i ρ), mirror image included. 3 channels at 4 standard errors: .1 %.
TEST(SubstratePhysics, SmoothCoatOverHalfWhiteIsSaunderson) {
  SlabValues coat = default_slab();
  coat.diffuse_albedo = {0.0, 0.0, 0.0};
  coat.roughness = 0.0;
  coat.mean_free_path = {1e6, 1e6, 1e6};
  const PhysicalSurface surface(layers(coat, lambert({0.5, 0.5, 0.5}), 0.001));
  const RgbEstimate estimate = replicates(8, [&](const SamplePoints& points) {
    return surface.sample_albedo({0.0, 0.0, 1.0}, points, 4096);
  });
  const double truth = .04 + .96 * (1.0 - .5963) * .5 / (1.0 - .5963 * .5);
  for (const auto& [mean, error] : estimate.channel) {
    EXPECT_NEAR(mean, truth, 4.0 * error + 1e-4);
    EXPECT_LT(error, 2e-3);
  }
}

TEST(SubstratePhysics, EventsAreAllOutcomes) {
  for (const fs::path& path : shipped_trees()) {
    const SlabTree tree = read_tree(path);
    for (const DiffuseReading reading : {DiffuseReading::in_air, DiffuseReading::bare}) {
      const std::vector<PhysicalEvent> events = physical_events(tree, reading);
      EXPECT_LE(events.size(), 24u) << path;
      double sum = 0.0;
      for (const PhysicalEvent& event : events) sum += event.probability;
      EXPECT_NEAR(sum, 1.0, 1e-12) << path;
    }
  }
  // Second lobe × metalness × coverage by hand: ½ covered by two lobes, over a metal of two.
  SlabValues coat = tinted_coat(), metal = default_slab();
  coat.second_roughness_weight = metal.second_roughness_weight = 0.25;
  metal.diffuse_albedo = {0.0, 0.0, 0.0};
  metal.f0 = {0.9, 0.7, 0.4};
  const std::vector<PhysicalEvent> events = physical_events(covered(coat, 0.5, metal));
  ASSERT_EQ(events.size(), 6u);
  std::vector<double> probabilities;
  for (const PhysicalEvent& event : events) probabilities.push_back(event.probability);
  std::ranges::sort(probabilities);
  const std::array expected{.5 * .0625, .5 * .1875, .5 * .1875, .5 * .25, .5 * .5625, .5 * .75};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(probabilities[i], expected[i], 1e-14);
}

// No matter makes light. An albedo of 1 is allowed to exceed it by 4 of its own standard errors: 38 trees, 2 views and
// 3 channels fail with a probability of 4 % at most under fresh seeds, were all of them white.
TEST(SubstratePhysics, ShippedTreesKeepEnergy) {
  for (const fs::path& path : shipped_trees()) {
    const PhysicalSurface surface(read_tree(path));
    for (const double theta : {10.0, 70.0}) {
      const Direction wo = direction(radians(theta), 0.0);
      const RgbEstimate estimate =
          replicates(9, [&](const SamplePoints& points) { return surface.sample_albedo(wo, points, 64); });
      for (const auto& [mean, error] : estimate.channel) {
        EXPECT_LE(mean, 1.0 + 4.0 * error) << path << " " << theta;
        EXPECT_GT(mean, 0.0) << path << " " << theta;
        EXPECT_LT(error, 0.03) << path << " " << theta;
      }
    }
  }
}

}  // namespace
}  // namespace lobefit
