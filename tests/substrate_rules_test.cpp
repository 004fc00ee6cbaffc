// Rules that collapse Substrate trees, their fit, and what simplifying costs.
#include "fit/substrate_rules.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "evaluate/substrate_storage.h"
#include "models/substrate/conversions.h"
#include "models/substrate/regime.h"
#include "reference/render.h"
#include "reference/substrate/tree_albedo.h"
#include "reference/substrate/tree_json.h"
#include "report/slab_validation.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

const fs::path data = LOBEFIT_DATA_FOLDER;

RuleConstants shipped() { return read_rules(data / "substrate_rules.json"); }

Direction view_at(double degrees) { return direction(radians(degrees), 0.0); }

/// Directional albedo of a lone slab, by the same sampling as trees.
Rgb albedo_of(const SlabValues& slab, double degrees) {
  std::vector<Closure> closures(1);
  closures[0].slab = slab;
  return directional_albedo(closures, view_at(degrees), 48);
}

SlabValues clear_coat(double index, double roughness, const Rgb& transmittance = {1.0, 1.0, 1.0}) {
  SlabValues coat = default_slab();
  const double f0 = f0_of_index(index);
  coat.f0 = {f0, f0, f0};
  coat.roughness = roughness;
  coat.diffuse_albedo = {0.0, 0.0, 0.0};
  coat.thickness = 0.01;
  coat.mean_free_path = mean_free_path_of(transmittance, 0.01);
  return coat;
}

SlabValues bare_diffuse(double albedo) {
  SlabValues slab = default_slab();
  slab.f0 = {0.0, 0.0, 0.0};
  slab.diffuse_albedo = {albedo, albedo, albedo};
  return slab;
}

/// Exact reflectance of a smooth interface, by the sines' law and Fresnel's equations.
double fresnel(double cosine, double index) {
  const double inner = std::sqrt(1.0 - (1.0 - cosine * cosine) / (index * index));
  const double s = (cosine - index * inner) / (cosine + index * inner);
  const double p = (index * cosine - inner) / (index * cosine + inner);
  return 0.5 * (s * s + p * p);
}

/// Saunderson 1942 without absorption, F_i from quadrature of Fresnel's equations.
double saunderson(double cosine, double index, double albedo) {
  double outside = 0.0;
  constexpr int steps = 20000;
  for (int i = 0; i < steps; ++i) outside += fresnel(std::sqrt((i + 0.5) / steps), index) / steps;
  const double inside = 1.0 - (1.0 - outside) / (index * index);
  const double f = fresnel(cosine, index);
  return f + (1.0 - f) * (1.0 - inside) * albedo / (1.0 - inside * albedo);
}

// ---- the rules ----------------------------------------------------------------------------------------------------

TEST(FittedRules, SmoothClearCoatIsSaundersons) {
  const RuleConstants constants = shipped();
  // The published figure: .316 face-on at n = 1.5, rho = .5.
  EXPECT_NEAR(saunderson(1.0, 1.5, 0.5), 0.316, 5e-4);
  const SlabValues face_on = FittedBlend::vertical(clear_coat(1.5, 0.03), bare_diffuse(0.5), view_at(0.0).z, constants);
  EXPECT_NEAR(albedo_of(face_on, 0.0).x, 0.316, 0.02 * 0.316);
  for (const double index : {1.33, 1.5, 1.7}) {
    for (const double albedo : {0.1, 0.5, 0.9}) {
      for (const double degrees : {0.0, 40.0, 60.0, 70.0}) {
        SlabValues coat = clear_coat(index, 0.03), base = bare_diffuse(albedo);
        const double wo = view_at(degrees).z;
        const double truth = saunderson(wo, index, albedo);
        EXPECT_NEAR(albedo_of(FittedBlend::vertical(coat, base, wo, constants), degrees).x, truth, 0.07 * truth)
            << "n " << index << ", albedo " << albedo << ", view " << degrees;
      }
    }
  }
}

TEST(FittedRules, TheTreeAndTheBaselineMissIt) {
  SlabTree tree;
  const int top = tree.add_slab(clear_coat(1.5, 0.03)), bottom = tree.add_slab(bare_diffuse(0.5));
  tree.root = tree.add_vertical(top, bottom, 0.01);
  for (TreeNode& node : tree.nodes) node.slab.diffuse_model = 2.0;  // lambert: Chan keeps less than the albedo
  EXPECT_NEAR(directional_albedo(walk(tree), view_at(0.0)).x, 0.52, 0.005);
  // Its interface has a roughness between both, and a wider lobe returns less: .50 for .52.
  SlabValues blend = BaselineBlend::vertical(tree.node(top).slab, tree.node(bottom).slab);
  EXPECT_NEAR(albedo_of(blend, 0.0).x, 0.51, 0.015);
}

TEST(FittedRules, ChansTableIsItsAlbedo) {
  double worst = 0.0, squares = 0.0;
  int count = 0;
  for (int i = 0; i < 23; ++i) {
    for (int j = 1; j < 23; ++j) {
      const double roughness = (i + 0.5) / 23.0, cosine = j / 23.0;
      const Direction wo{std::sqrt(1.0 - cosine * cosine), 0.0, cosine};
      double albedo = 0.0;
      constexpr int rings = 48, sectors = 32;
      for (int a = 0; a < rings; ++a) {
        for (int b = 0; b < sectors; ++b) {
          const Direction wi = direction(std::acos(std::sqrt((a + 0.5) / rings)), pi * (b + 0.5) / sectors);
          albedo += evaluate_brdf<Chan2018, double>({{1.0, 1.0, 1.0}, roughness}, wi, wo).x * pi / (rings * sectors);
        }
      }
      const double error = std::abs(ChanAlbedo::evaluate(cosine, roughness) - albedo);
      worst = std::max(worst, error);
      squares += error * error;
      ++count;
    }
  }
  std::printf("Chan's table: worst %.1e, rms %.1e\n", worst, std::sqrt(squares / count));
  EXPECT_LT(worst, 0.013);
  EXPECT_LT(std::sqrt(squares / count), 0.0022);
}

TEST(FittedRules, F0OfAlbedoInvertsTheLobesAlbedo) {
  for (const double alpha : {0.01, 0.2, 0.8}) {
    for (const double cosine : {0.2, 0.6, 1.0}) {
      const LobeAlbedo<double> albedo = LobeAlbedo<double>::of(cosine, alpha);
      const Rgb f0{0.03, 0.4, 0.95};
      const Rgb back = f0_of_albedo(albedo.specular(f0, {1.0, 1.0, 1.0}), albedo);
      EXPECT_NEAR(back.x, f0.x, 1e-12);
      EXPECT_NEAR(back.y, f0.y, 1e-12);
      EXPECT_NEAR(back.z, f0.z, 1e-12);
    }
  }
}

TEST(FittedRules, MixesKeepTheLightOfTheirParts) {
  const RuleConstants constants = shipped();
  for (std::uint32_t i = 0; i < 40; ++i) {
    MixedPair pair = MixedPair::draw(7, i);
    // Lambert and equal roughness: no diffuse model's own loss, so that what is lerped is light.
    pair.background.diffuse_model = pair.foreground.diffuse_model = 2.0;
    for (const double degrees : {5.0, 60.0}) {
      const SlabValues slab =
          FittedBlend::horizontal(pair.background, pair.foreground, pair.mix, view_at(degrees).z, constants);
      const Rgb shown = albedo_of(slab, degrees);
      const Rgb truth = lerp(albedo_of(pair.background, degrees), albedo_of(pair.foreground, degrees), pair.mix);
      // The quadrature's 2e-3, and diffuse albedos cut at 1.
      EXPECT_NEAR(shown.x, truth.x, 0.01) << i;
      EXPECT_NEAR(shown.y, truth.y, 0.01) << i;
    }
  }
}

TEST(FittedRules, MixZeroAndOneAreTheParts) {
  const RuleConstants constants = shipped();
  const MixedPair pair = MixedPair::draw(3, 1);
  for (const double mix : {0.0, 1.0}) {
    const SlabValues& part = mix == 0.0 ? pair.background : pair.foreground;
    for (const SlabValues& slab : {BaselineBlend::horizontal(pair.background, pair.foreground, mix),
                                   FittedBlend::horizontal(pair.background, pair.foreground, mix, 0.6, constants)}) {
      EXPECT_NEAR(slab.roughness, part.roughness, 1e-6);
      EXPECT_NEAR(slab.f0.x, part.f0.x, 1e-6);
      EXPECT_NEAR(slab.diffuse_albedo.y, part.diffuse_albedo.y, 1e-6);
    }
  }
}

TEST(FittedRules, HalfTheBaselinesAndLessOnHeldOutPairs) {
  // Fresh pairs, unknown to the recipe. The shares are those that issue 6 asks for; over 60 pairs × 4 views × 3
  // channels the quantiles have a spread of a tenth of themselves, and the seed is fixed.
  constexpr std::uint32_t first = 5'000'000, count = 60;
  RulePairs pairs = RulePairs::draw(1, first, count);
  Axis axis{"pair", "", {}, false};
  for (std::uint32_t i = 0; i < count; ++i) axis.values.push_back(first + i);
  const Reference reference = layered_pair_albedo_reference();
  RenderOptions options;
  options.sampling.samples = 4096;
  Monitor monitor;
  pairs.albedo = render(reference, reference.defaults(), {axis}, pair_views(), options, monitor);
  for (const RuleScore& score : score_rules(pairs, shipped(), {})) {
    if (score.interface != "all" || (score.medium != "all" && score.medium != "clear+absorbing")) continue;
    EXPECT_GT(score.fitted.count, 100u);
    EXPECT_LE(score.fitted.p90, score.baseline.p90 / 3.0) << score.bottom << ", " << score.medium;
    EXPECT_LT(score.fitted.median, score.tree.median / 2.0) << score.bottom << ", " << score.medium;
    if (score.bottom == "diffuse") {
      EXPECT_LE(score.fitted.median, 0.04) << score.medium;
    }
  }
  const MixScore mixes = score_mixes(pairs, shipped(), {});
  EXPECT_LT(mixes.fitted.median, mixes.baseline.median / 2.0);
  EXPECT_LT(mixes.fitted_haze.p90, mixes.baseline.p90 / 2.0);
}

TEST(RuleFits, FindTheConstantsThatMadeTheTables) {
  RuleConstants made = FittedBlend::initial();
  std::size_t number = 0;
  FittedBlend::describe(
      made, [&](double& member, const ParameterInfo&) { member += 0.03 * std::sin(static_cast<double>(++number)); });
  RulePairs pairs = RulePairs::draw(2, 0, 24);
  const auto table_of = [&](const Grid& grid) {
    Table table;
    table.grid = grid;
    table.channels = 3;
    Axis axis{"pair", "", {}, false};
    for (std::size_t i = 0; i < pairs.layers.size(); ++i) axis.values.push_back(static_cast<double>(i));
    table.parameter_axes = {axis};
    table.allocate();
    return table;
  };
  pairs.albedo = table_of(pair_views());
  pairs.brdf = table_of(pair_grid());
  for (Table* table : {&pairs.albedo, &pairs.brdf}) {
    for (std::size_t entry = 0; entry < table->entries(); ++entry) {
      const LayeredPair& pair = pairs.layers[table->parameter_row(entry)];
      const Direction wo = table->wo(entry);
      const SlabValues slab = FittedBlend::vertical(pair.top, pair.bottom, wo.z, made);
      Rgb value;
      if (table == &pairs.brdf) {
        value = evaluate_brdf<Slab, double>(slab, table->wi(entry), wo);
      } else {
        std::vector<Closure> closures(1);
        closures[0].slab = slab;
        value = directional_albedo(closures, wo, 32);
      }
      const float channels[] = {static_cast<float>(value.x), static_cast<float>(value.y), static_cast<float>(value.z)};
      for (std::size_t c = 0; c < 3; ++c) table->values[c * table->entries() + entry] = channels[c];
    }
  }
  pairs.mixes.clear();
  Monitor monitor;
  const RuleConstants found = constants_of(fit_rules(pairs, {.brdf_weight = 0.5}, monitor));
  // What two lobes would show was not made, and pulls at what concerns lobes; bodies and media are found again.
  EXPECT_NEAR(found.light_path, made.light_path, 0.05);
  EXPECT_NEAR(found.scattering, made.scattering, 0.05);
  EXPECT_NEAR(found.milky_path, made.milky_path, 0.1);
  EXPECT_NEAR(found.inside_path, made.inside_path, 0.25);
}

// ---- simplifying --------------------------------------------------------------------------------------------------

TEST(Simplify, StagesShrinkToOneClosure) {
  const RuleConstants constants = shipped();
  for (const auto& file : fs::directory_iterator(data / "substrate")) {
    const SlabTree tree = read_tree(file.path().string());
    for (const BlendRule rule : {BlendRule::baseline, BlendRule::fitted, BlendRule::fitted_haze}) {
      const std::vector<SimplifiedTree> stages = simplify_deepest_first(tree, rule, constants);
      EXPECT_TRUE(stages.front().steps.empty());
      EXPECT_EQ(stages.back().closures, 1u) << file.path();
      EXPECT_LE(stages.back().bytes, 20) << file.path();
      for (std::size_t i = 1; i < stages.size(); ++i) {
        EXPECT_LE(stages[i].closures, stages[i - 1].closures);
        EXPECT_EQ(stages[i].steps.size(), i);
      }
    }
  }
}

TEST(Simplify, DeepestOperatorGoesFirst) {
  const SlabTree tree = read_tree((data / "substrate/slide_collapse.json").string());
  const std::vector<SimplifiedTree> stages = simplify_deepest_first(tree, BlendRule::fitted, shipped());
  // S2's example V(A, H(B, C)): first the mix, then the layers; 3, 2, 1 closures.
  ASSERT_GE(stages.size(), 3u);
  EXPECT_EQ(stages[0].closures, 3u);
  EXPECT_EQ(stages[1].closures, 2u);
  EXPECT_EQ(stages[2].closures, 1u);
  EXPECT_NE(step_text(tree, stages[1].steps[0]).find("horizontal"), std::string::npos);
}

TEST(Simplify, CoverageOverACoatIsTheMixOfCoatedAndBare) {
  const RuleConstants constants = shipped();
  SlabTree tree;
  const int coat = tree.add_slab(clear_coat(1.5, 0.2, {0.9, 0.5, 0.3}));
  const int covered = tree.add_coverage(coat, 0.0);
  SlabValues metal = default_slab();
  metal.f0 = {0.9, 0.7, 0.4};
  metal.diffuse_albedo = {0.0, 0.0, 0.0};
  const int base = tree.add_slab(metal);
  tree.root = tree.add_vertical(covered, base, 0.01);
  const auto shown = [&](double coverage) {
    tree.node(covered).amount = coverage;
    const std::vector<SimplifiedTree> stages = simplify_deepest_first(tree, BlendRule::fitted, constants);
    const double degrees = 40.0;
    return directional_albedo(walk(simplified(tree, stages.back().steps, {constants, view_at(degrees).z})),
                              view_at(degrees), 48);
  };
  const Rgb none = shown(0.0), half = shown(0.5), all = shown(1.0);
  EXPECT_NEAR(none.x, albedo_of(metal, 40.0).x, 2e-3);  // coverage 0 removes the coat
  EXPECT_NEAR(half.x, 0.5 * (none.x + all.x), 5e-3);
  EXPECT_NEAR(half.z, 0.5 * (none.z + all.z), 5e-3);
}

TEST(Validation, ErrorDrivenIsNeverAboveTheBaseline) {
  const RuleConstants constants = shipped();
  Monitor monitor;
  for (const char* name : {"coated_metal", "slide_collapse", "gold_leaf"}) {
    const SlabTree tree = read_tree((data / "substrate" / (std::string(name) + ".json")).string());
    const SlabValidation validation =
        validate_tree(tree, constants, {.brdf_samples = 64, .albedo_paths = 2048, .spheres = false}, monitor);
    ASSERT_EQ(validation.strategies.size(), 3u);
    for (const int bytes : {12, 16, 20, 24, 28, 40, 60}) {
      const ValidatedStage* baseline = validation.strategies[0].best(bytes);
      const ValidatedStage* driven = validation.strategies[2].best(bytes);
      if (!baseline) continue;
      ASSERT_TRUE(driven) << name << ", " << bytes;
      // Searched by albedos from 144 directions, judged by 576: their difference is below 2 %.
      EXPECT_LE(driven->model.error(), 1.02 * baseline->model.error()) << name << ", " << bytes;
    }
    const Json json = validation.json({});
    EXPECT_EQ(json["levels"][0]["simplification"]["error"], 0.0);
    EXPECT_TRUE(json["levels"][0]["collapsed"].empty());
    EXPECT_GT(json["levels"][0]["bytes"].get<int>(), json["levels"].back()["bytes"].get<int>());
  }
}

// Lambert without an interface is the same as matter and as a slab, but for the noise of the former.
TEST(Validation, SpheresOfBareBodiesAgree) {
  SlabTree tree;
  SlabValues slab = default_slab();
  slab.f0 = {0.0, 0.0, 0.0};
  slab.diffuse_albedo = {0.6, 0.3, 0.1};
  slab.diffuse_model = 2.0;
  tree.root = tree.add_slab(slab);
  Monitor monitor;
  const TreeJudge judge(tree, shipped(), {.brdf_samples = 64, .albedo_paths = 1024}, monitor);
  EXPECT_LE(judge.model({}).sphere_delta_e_itp, 0.05 + 2.0 * judge.sphere_truth_error());
  EXPECT_LE(judge.sphere_truth_error(), 0.5);
  EXPECT_EQ(judge.simplification({}).sphere_delta_e_itp, 0.0);
}

TEST(Validation, SameBitsTwice) {
  const SlabTree tree = read_tree((data / "substrate/coated_metal.json").string());
  Monitor monitor;
  const ValidationOptions options{.brdf_samples = 64, .albedo_paths = 1024, .spheres = true};
  EXPECT_EQ(validate_tree(tree, shipped(), options, monitor).json({}),
            validate_tree(tree, shipped(), options, monitor).json({}));
}

TEST(StoredClosures, TakeTheBytesThatAreCounted) {
  for (const auto& file : fs::directory_iterator(data / "substrate")) {
    const std::vector<Closure> closures = walk(read_tree(file.path()));
    const PackedMaterial packed = pack_material(stored_closures(closures, 0.7));
    EXPECT_EQ(packed.storage.bytes(), tree_bytes(closures)) << file.path();
  }
}

TEST(ClosureSelection, IsUnbiasedAndItsVarianceIsWhatItSays) {
  const std::vector<Closure> closures = walk(read_tree((data / "substrate/car_paint.json").string()));
  const Direction wo = view_at(35.0), wi = direction(radians(50.0), radians(160.0));
  const ClosureSelection selection = ClosureSelection::of(closures, wo);
  ASSERT_EQ(selection.probabilities.size(), 3u);
  double probability_sum = 0.0, sum = 0.0, squares = 0.0;
  for (const double probability : selection.probabilities) probability_sum += probability;
  EXPECT_NEAR(probability_sum, 1.0, 1e-12);
  // Every chance of [0, 1) in turn: what choose() does, averaged.
  constexpr int draws = 100000;
  for (int i = 0; i < draws; ++i) {
    const std::size_t k = selection.choose((i + 0.5) / draws);
    const double estimate = closures[k].evaluate(wi, wo).x / selection.probabilities[k];
    sum += estimate / draws;
    squares += estimate * estimate / draws;
  }
  const double f = evaluate(closures, wi, wo).x;
  EXPECT_NEAR(sum, f, 1e-4 * f);
  EXPECT_NEAR(selection.variance(closures, wi, wo).x, squares - sum * sum, 1e-3 * squares);
  EXPECT_GT(selection.variance(closures, wi, wo).x, 0.0);
  // In a furnace the choice by albedo costs nothing: every closure's estimate is the whole albedo.
  const std::vector<Rgb> albedos = closure_albedos(closures, wo);
  const double whole = mean_channel(directional_albedo(closures, wo));
  for (std::size_t k = 0; k < closures.size(); ++k) {
    EXPECT_NEAR(mean_channel(albedos[k]) / selection.probabilities[k], whole, 1e-9);
  }
}

TEST(Regimes, FollowMeanFreePathThicknessAndPixel) {
  SlabValues skin = default_slab();
  skin.mean_free_path = {0.1, 0.05, 0.02};
  EXPECT_EQ(regime_of(skin, true, 1.0), Regime::opaque_diffuse);
  EXPECT_EQ(regime_of(skin, true, 0.01), Regime::optically_thick);
  skin.thickness = 0.05;
  EXPECT_EQ(regime_of(skin, false, 1.0), Regime::optically_thin);
  skin.thickness = 10.0;  // nothing passes: as if it were the lowest
  EXPECT_EQ(regime_of(skin, false, 1.0), Regime::opaque_diffuse);
  skin.thickness = 0.05;
  skin.diffuse_albedo = {0.0, 0.0, 0.0};
  EXPECT_EQ(regime_of(skin, false, 1.0), Regime::translucent);
}

TEST(Statistics, ExactOnesNeedMoreClosuresUnderPartialCoverage) {
  Monitor monitor;
  const SlabTree tree = read_tree((data / "substrate/worn_car_paint.json").string());
  const TreeJudge judge(tree, shipped(), {.brdf_samples = 32, .albedo_paths = 1024, .spheres = false}, monitor);
  const TreeJudge::ExactStatistics exact = judge.exact_statistics();
  EXPECT_GT(exact.closures, walk(tree).size());
  EXPECT_GT(exact.difference.error(), 0.0);
  // Where all is covered there is one outcome.
  const SlabTree whole = read_tree((data / "substrate/coated_diffuse.json").string());
  const TreeJudge same(whole, shipped(), {.brdf_samples = 32, .albedo_paths = 1024, .spheres = false}, monitor);
  EXPECT_NEAR(same.exact_statistics().difference.error(), 0.0, 1e-9);
}

TEST(RuleFiles, SayWhatIsWrong) {
  const fs::path path = fs::path(::testing::TempDir()) / "rules.json";
  const auto complaint = [&](const std::string& text) {
    std::FILE* file = std::fopen(path.c_str(), "w");
    std::fputs(text.c_str(), file);
    std::fclose(file);
    try {
      read_rules(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::invalid_input);
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(complaint("{}").find("constants"), std::string::npos);
  EXPECT_NE(complaint(R"({"constants": {"light_path": 99}})").find("$.constants.light_path"), std::string::npos);
  EXPECT_NE(complaint(R"({"constants": {"light_path": {"value": "x"}}})").find("number"), std::string::npos);
}

}  // namespace
}  // namespace lobefit
