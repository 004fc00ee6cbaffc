// lobefit refit substrate-rules: pairs, fit, judgement, trees, page.
#include <fmt/format.h>

#include <iostream>

#include "cli/output_folder.h"
#include "cli/substrate_rules.h"
#include "cli/table_file.h"
#include "evaluate/shader.h"
#include "evaluate/substrate_shader.h"
#include "fit/substrate_rules.h"
#include "reference/output_file.h"
#include "reference/render.h"
#include "reference/substrate/tree_json.h"
#include "report/chart.h"
#include "report/shader_text.h"
#include "report/slab_validation.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

constexpr std::array budgets{12, 16, 20, 24, 28, 40};

struct RuleRecipe {
  std::string name, title, description;
  std::uint32_t pairs = 0, held_out = 0;
  std::uint64_t pairs_seed = 1, samples = 0, albedo_paths = 0, tree_samples = 0;
  RuleFitOptions options;
  std::string diffuse_model;

  static RuleRecipe read(const fs::path& path) {
    const Json json = parse_json(read_file(path), path.string());
    const JsonReader reader(json, path.string());
    reader.allow({"recipe", "kind", "title", "description", "pairs", "held_out", "pairs_seed", "samples",
                  "albedo_paths", "diffuse_model", "brdf_weight", "tree_samples"});
    const auto number = [&](const char* key, double lower, double upper) {
      const JsonReader member = reader.at(key);
      const double value = member.number();
      if (!(value >= lower && value <= upper && value == std::floor(value))) {
        throw member.error(fmt::format("{} is no whole number from {} to {}", value, lower, upper), "choose another");
      }
      return value;
    };
    RuleRecipe recipe;
    recipe.name = reader.at("recipe").text();
    recipe.title = reader.at("title").text();
    recipe.description = reader.at("description").text();
    recipe.pairs = static_cast<std::uint32_t>(number("pairs", 20, 1e6));
    recipe.held_out = static_cast<std::uint32_t>(number("held_out", 20, 1e6));
    recipe.pairs_seed = static_cast<std::uint64_t>(number("pairs_seed", 0, 1e9));
    recipe.samples = static_cast<std::uint64_t>(number("samples", replicate_count, 1e7));
    recipe.albedo_paths = static_cast<std::uint64_t>(number("albedo_paths", replicate_count, 1e8));
    recipe.tree_samples = static_cast<std::uint64_t>(number("tree_samples", replicate_count, 1e7));
    const JsonReader weight = reader.at("brdf_weight");
    recipe.options.brdf_weight = weight.number();
    if (!(recipe.options.brdf_weight >= 0.0 && recipe.options.brdf_weight < 1.0)) {
      throw weight.error("the share of BRDFs is out of range", "choose one from 0 to below 1");
    }
    const JsonReader model = reader.at("diffuse_model");
    recipe.diffuse_model = model.text();
    const auto found = std::ranges::find(slab_diffuse_choices, recipe.diffuse_model);
    if (found == slab_diffuse_choices.end()) {
      throw model.error("unknown diffuse model", fmt::format("choose {}", fmt::join(slab_diffuse_choices, ", ")));
    }
    recipe.options.diffuse_model = static_cast<int>(found - slab_diffuse_choices.begin());
    return recipe;
  }
};

/// The truth of some pairs as a table in the results' folder: rendered, or taken up where an earlier run stopped.
Table pair_table(const fs::path& path, const Reference& reference, const Grid& grid, const RuleRecipe& recipe,
                 std::uint32_t first, std::uint32_t count, std::uint64_t samples, bool resume, const Context& context,
                 Monitor& monitor) {
  Axis pairs{"pair", "", {}, false};
  for (std::uint32_t i = first; i < first + count; ++i) pairs.values.push_back(i);
  ParameterValues values = reference.defaults();
  values.set("pairs_seed", static_cast<double>(recipe.pairs_seed));
  RenderOptions options;
  options.sampling.samples = samples;
  options.sampling.seed = context.seed;
  return render_into(path, resume, {}, context, [&](const RenderJob& job) {
    return render(reference, values, {pairs}, grid, options, monitor, job);
  });
}

RulePairs rule_pairs(const fs::path& folder, const std::string& name, const RuleRecipe& recipe, std::uint32_t first,
                     std::uint32_t count, bool resume, const Context& context, Monitor& monitor) {
  RulePairs pairs = RulePairs::draw(recipe.pairs_seed, first, count);
  pairs.albedo = pair_table(folder / (name + "_albedo.exr"), layered_pair_albedo_reference(), pair_views(), recipe,
                            first, count, recipe.albedo_paths, resume, context, monitor);
  pairs.brdf = pair_table(folder / (name + "_brdf.exr"), layered_pair_reference(), pair_grid(), recipe, first, count,
                          recipe.samples, resume, context, monitor);
  return pairs;
}

struct JudgedTree {
  std::string name;
  SlabValidation validation;
};

std::vector<JudgedTree> judge_trees(const RuleConstants& constants, const RuleRecipe& recipe, const Context& context,
                                    Monitor& monitor) {
  std::vector<fs::path> paths;
  for (const auto& file : fs::directory_iterator(data_folder() / "substrate")) {
    if (file.path().extension() == ".json") paths.push_back(file.path());
  }
  std::ranges::sort(paths);
  std::vector<JudgedTree> trees;
  for (const fs::path& path : paths) {
    trees.push_back({path.stem().string(), validate_tree(read_tree(path), constants,
                                                         {.brdf_samples = recipe.tree_samples,
                                                          .albedo_paths = 16 * recipe.tree_samples,
                                                          .seed = context.seed,
                                                          .spheres = false},
                                                         monitor)});
  }
  return trees;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

/// One budget over all trees that fit it.
struct BudgetScore {
  int bytes = 0;
  std::size_t trees = 0, worse = 0;                         // worse: error-driven above the baseline
  double baseline = 0.0, fitted = 0.0, error_driven = 0.0;  // medians
  double ratio = 0.0;                                       // median of error-driven over baseline
};

std::vector<BudgetScore> score_budgets(const std::vector<JudgedTree>& trees) {
  std::vector<BudgetScore> scores;
  for (const int bytes : budgets) {
    BudgetScore score{.bytes = bytes};
    std::vector<double> errors[3], ratios;
    for (const JudgedTree& tree : trees) {
      const ValidatedStage* best[3];
      for (std::size_t s = 0; s < 3; ++s) best[s] = tree.validation.strategies[s].best(bytes);
      if (!best[0] || !best[1] || !best[2]) continue;
      ++score.trees;
      for (std::size_t s = 0; s < 3; ++s) errors[s].push_back(best[s]->model.error());
      ratios.push_back(best[2]->model.error() / std::max(best[0]->model.error(), 1e-9));
      if (best[2]->model.error() > best[0]->model.error() * (1.0 + 1e-9)) ++score.worse;
    }
    score.baseline = median(errors[0]);
    score.fitted = median(errors[1]);
    score.error_driven = median(errors[2]);
    score.ratio = median(ratios);
    scores.push_back(score);
  }
  return scores;
}

Json quantiles_json(const ErrorQuantiles& q) {
  return {{"count", q.count}, {"median", q.median}, {"p90", q.p90}, {"max", q.largest}};
}

std::string quantiles_text(const ErrorQuantiles& q) {
  return fmt::format("{:.3f} / {:.3f} / {:.3f}", q.median, q.p90, q.largest);
}

const RuleScore& score_of(const std::vector<RuleScore>& scores, const std::string& bottom, const std::string& medium) {
  return *std::ranges::find_if(scores, [&](const RuleScore& score) {
    return score.bottom == bottom && score.medium == medium && score.interface == "all";
  });
}

std::string conclusion_of(const std::vector<RuleScore>& scores, const std::vector<BudgetScore>& trees) {
  std::string text;
  for (const char* bottom : {"diffuse", "conductor"}) {
    const RuleScore& score = score_of(scores, bottom, "all");
    text += fmt::format(
        "Over held-out {} bottoms the fitted rule's P90 is {:.3f}, {:.2f} of the baseline's {:.3f}; its "
        "median {:.3f}. ",
        bottom, score.fitted.p90, score.fitted.p90 / score.baseline.p90, score.baseline.p90, score.fitted.median);
  }
  std::size_t worse = 0;
  for (const BudgetScore& score : trees) worse += score.worse;
  text += fmt::format("Over the shipped trees error-driven collapse exceeds the baseline {} times", worse);
  for (const BudgetScore& score : trees) {
    if (score.bytes <= 20)
      text += fmt::format("; at {} bytes it has {:.2f} of its error in the median", score.bytes, score.ratio);
  }
  return text + ".";
}

std::string rules_page(const RuleRecipe& recipe, const LeastSquaresSolution& solution,
                       const std::vector<RuleScore>& scores, const MixScore& mixes,
                       const std::vector<JudgedTree>& trees, const std::vector<BudgetScore>& budget_scores,
                       const std::string& conclusion, const std::string& command) {
  std::string page = "# " + recipe.title + "\n\n" + recipe.description + "\n\n**" + conclusion + "**\n\nMade by `" +
                     command + "`, lobefit " LOBEFIT_VERSION ".\n\n";
  page +=
      "## The rules\n\nA material is stored where the view is known: what is stored may depend on its cosine μ "
      "(without "
      "a view: 2/3). Per channel; E(slab) is a slab's specular albedo at the view, α = roughness², n the top's index "
      "from its mean F0, τ its depth (thickness over mean free path), ω and g its single-scattering albedo (from the "
      "diffuse albedo) and phase; v = 1/√(1 - (1 - μ²)/n²).\n\n"
      "**Vertical** (top over bottom, with fuzz, F90 and anisotropy carried as in models/substrate/blend.h):\n\n"
      "1. Bottom's body: ρ_b = ρ/((1 - F_b) + F_b ρ), F_b the inner diffuse Fresnel reflectance of its own index. "
      "Under "
      "the interface between the slabs: ρ̂ = (1 - F_d)(1 - F_u) ρ_b/(1 - F_u ρ_b) + F_d.\n"
      "2. Bottom's lobe: F_r = f (e + f (1 - e)), e = mean albedo of a lobe of its α with F = 1; f its F0, or of two "
      "dielectrics that of their relative index.\n"
      "3. Medium: τ' = τ (1 - ω g), ω' = ω (1 - g)/(1 - ω g), K = p (1 - ω') τ', S = s ω' τ', Kubelka and Munk's R and "
      "T; R(p) = R + T² (ρ̂ + F_r)/(1 - R (ρ̂ + F_r)), less what the lobe takes.\n"
      "4. Interface: E_t = E(top) + (F_exact(μ) - F_Schlick(μ)) e^(-k α_t); F_i = inner diffuse Fresnel(n) (1 - q "
      "α_t).\n"
      "5. Body: (1 - E_t)(1 - F_i) R(p)/(1 - F_i R(p_in)), p from (v + p_l)/2 at ω = 0 to p_m at ω = 1.\n"
      "6. Lobe: (1 - E_t)(1 - F_x) F_r T/(1 - F_x F_r T), T = e^(-τ (v + p')), p' from v to p_s with min(α_b + α_t, "
      "1), "
      "F_x from F_t to F_i with 1 - e^(-h_b α_b - h_t α_t).\n"
      "7. α_b' = √((n^e α_b)² + (b (n - 1) α_t)²); one lobe: α = ((E_t α_t^m + L α_b'^m)/(E_t + L))^(1/m), m = m_v, L "
      "the lobe of 6; two lobes: α_t, and α_b' with weight L/(E_t + L).\n"
      "8. F0 and diffuse albedo of the result: those with which the slab returns E_t + L and the body at μ; the body "
      "over what the diffuse model keeps of the light at μ (Chan's, by the table of models/energy/chan_albedo.h).\n\n"
      "**Horizontal**: E and body = (1 - E) ρ are lerped and inverted as in 8; alphas as in "
      "7 with m_h. **Coverage**: the outcomes (both, top alone, bottom alone) mixed horizontally in proportion.\n\n"
      "## Constants\n\n| constant | | value | 95 % interval | |\n|---|---|---|---|---|\n";
  std::size_t k = 0;
  RuleConstants described{};
  FittedBlend::describe(described, [&](double&, const ParameterInfo& info) {
    const FittedVariable& v = solution.variables[k++];
    page += fmt::format("| {} | {} | {:.4f} | {} | {} |\n", info.name, info.symbol, v.value,
                        v.at_bound        ? "at its bound"
                        : !v.identifiable ? "not identifiable"
                                          : fmt::format("[{:.4f}, {:.4f}]", v.ci_low, v.ci_high),
                        info.doc);
  });
  page += fmt::format("\nIntervals are over the {} drawn pairs.\n", recipe.pairs);
  page += fmt::format(
      "\n## Held-out pairs\n\nRelative error of directional albedos, median / P90 / max, over {} pairs × 4 views × 3 "
      "channels. Tree: Substrate's walk, two closures. The others: one closure; haze keeps two lobes (+4 bytes).\n\n"
      "| bottom | medium | interface | n | baseline | tree | fitted | fitted, haze "
      "|\n|---|---|---|---|---|---|---|---|\n",
      recipe.held_out);
  for (const RuleScore& score : scores) {
    if (score.fitted.count == 0) continue;
    page += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", score.bottom, score.medium, score.interface,
                        score.fitted.count, quantiles_text(score.baseline), quantiles_text(score.tree),
                        quantiles_text(score.fitted), quantiles_text(score.fitted_haze));
  }
  page += fmt::format(
      "\nMixes: rms of the difference of log(1 + 20 f cos θ) from the mix of both, median / P90 / max over {} pairs: "
      "baseline {}, fitted {}, fitted with haze {}.\n",
      recipe.held_out, quantiles_text(mixes.baseline), quantiles_text(mixes.fitted), quantiles_text(mixes.fitted_haze));
  page +=
      "\n## Shipped trees: error against bytes\n\n![error against bytes](trees.png)\n\nLeast error against the layers "
      "as matter of all stages within the budget, medians over the trees that fit it.\n\n"
      "| bytes | trees | baseline | fitted | error-driven | error-driven over baseline | times above |\n"
      "|---|---|---|---|---|---|---|\n";
  for (const BudgetScore& score : budget_scores) {
    page += fmt::format("| {} | {} | {:.4f} | {:.4f} | {:.4f} | {:.2f} | {} |\n", score.bytes, score.trees,
                        score.baseline, score.fitted, score.error_driven, score.ratio, score.worse);
  }
  page += "\n| tree | full tree: bytes, error |";
  for (const int bytes : budgets) page += fmt::format(" {} B |", bytes);
  page += "\n|---|---|";
  for (std::size_t i = 0; i < budgets.size(); ++i) page += "---|";
  page += "\n";
  for (const JudgedTree& tree : trees) {
    const ValidatedStage& full = tree.validation.strategies[0].stages.front();
    page += fmt::format("| {} | {}, {:.3f} |", tree.name, full.stage.bytes, full.model.error());
    for (const int bytes : budgets) {
      std::string cell;
      for (const ValidatedStrategy& strategy : tree.validation.strategies) {
        const ValidatedStage* best = strategy.best(bytes);
        cell += (cell.empty() ? "" : " → ") + (best ? fmt::format("{:.3f}", best->model.error()) : std::string("–"));
      }
      page += " " + cell + " |";
    }
    page += "\n";
  }
  page += "\nCells: baseline → fitted → error-driven.\n";
  return page;
}

std::string trees_figure(const std::vector<BudgetScore>& scores) {
  ChartPanel panel{
      .title = "median over the shipped trees", .series = std::vector<ChartSeries>(3), .lower = 0.0, .upper = 0.0};
  for (const BudgetScore& score : scores) {
    const double errors[] = {score.baseline, score.fitted, score.error_driven};
    for (std::size_t s = 0; s < 3; ++s) {
      panel.series[s].points.push_back({static_cast<double>(score.bytes), errors[s]});
      panel.series[s].line.emplace_back(score.bytes, errors[s]);
      panel.upper = std::max(panel.upper, 1.1 * errors[s]);
    }
  }
  return chart_figure({panel}, {"baseline, deepest first", "fitted, deepest first", "fitted, error-driven"},
                      "What simplifying Substrate trees costs", "error against the layers as matter", "bytes per pixel",
                      {.left = 8.0, .right = 44.0, .tick = 4.0});
}

}  // namespace

fs::path data_folder() {
  if (const char* folder = std::getenv("LOBEFIT_DATA")) return folder;
  return LOBEFIT_DATA_FOLDER;
}
fs::path shipped_rules() { return data_folder() / "substrate_rules.json"; }

std::string rules_shader(const std::string& language, const RuleConstants& constants, const std::string& command) {
  const std::vector<std::string> provenance{
      "Rules that make one Substrate slab of two, for the view that the base pass knows.",
      "Made by `" + command + "`, lobefit " LOBEFIT_VERSION ".",
      "Formulas and intervals: docs/substrate_rules.md of lobefit."};
  return blend_shader(language, constants, provenance);
}

void refit_substrate_rules(const fs::path& path, const std::string& output, bool resume, const Context& context) {
  const RuleRecipe recipe = RuleRecipe::read(path);
  const fs::path destination = output.empty() ? fs::path("out") / recipe.name : fs::path(output);
  OutputFolder folder(destination, context.force || resume);
  fs::create_directories(destination);  // tables are kept there as they are finished
  const auto monitor = context.monitor();
  constexpr std::uint32_t first_held_out = 1'000'000;
  const RulePairs training = rule_pairs(destination, "training", recipe, 0, recipe.pairs, resume, context, *monitor);
  const RulePairs held_out =
      rule_pairs(destination, "held_out", recipe, first_held_out, recipe.held_out, resume, context, *monitor);

  context.say("fitting the rules' constants");
  const LeastSquaresSolution solution = fit_rules(training, recipe.options, *monitor);
  const RuleConstants constants = constants_of(solution);
  const std::vector<RuleScore> scores = score_rules(held_out, constants, recipe.options);
  const MixScore mixes = score_mixes(held_out, constants, recipe.options);
  context.say("judging the shipped trees");
  const std::vector<JudgedTree> trees = judge_trees(constants, recipe, context, *monitor);
  const std::vector<BudgetScore> budget_scores = score_budgets(trees);
  const std::string conclusion = conclusion_of(scores, budget_scores);

  const Json provenance{{"version", LOBEFIT_VERSION},
                        {"command", context.command},
                        {"seed", context.seed},
                        {"pairs", recipe.pairs},
                        {"held_out", recipe.held_out},
                        {"diffuse_model", recipe.diffuse_model},
                        {"training_albedo_sha256", sha256_of_file(destination / "training_albedo.exr")},
                        {"training_brdf_sha256", sha256_of_file(destination / "training_brdf.exr")}};
  Json rules = rules_json(solution);
  rules["diffuse_model"] = recipe.diffuse_model;
  rules["provenance"] = provenance;
  Json rows = Json::array(), budget_rows = Json::array(), tree_rows = Json::object();
  for (const RuleScore& score : scores) {
    rows.push_back({{"model", "slab"},
                    {"domain", {{"bottom", score.bottom}, {"medium", score.medium}, {"interface", score.interface}}},
                    {"method", "monte_carlo"},
                    {"albedo_error",
                     {{"baseline", quantiles_json(score.baseline)},
                      {"tree", quantiles_json(score.tree)},
                      {"fitted", quantiles_json(score.fitted)},
                      {"fitted_haze", quantiles_json(score.fitted_haze)}}}});
  }
  for (const BudgetScore& score : budget_scores) {
    budget_rows.push_back({{"bytes", score.bytes},
                           {"trees", score.trees},
                           {"baseline", score.baseline},
                           {"fitted", score.fitted},
                           {"error_driven", score.error_driven},
                           {"ratio", score.ratio},
                           {"above_baseline", score.worse}});
  }
  for (const JudgedTree& tree : trees) tree_rows[tree.name] = tree.validation.json(provenance);
  const Json document{
      {"recipe", recipe.name},
      {"title", recipe.title},
      {"description", recipe.description},
      {"rows", rows},
      {"mixes",
       {{"baseline", quantiles_json(mixes.baseline)},
        {"fitted", quantiles_json(mixes.fitted)},
        {"fitted_haze", quantiles_json(mixes.fitted_haze)}}},
      {"budgets", budget_rows},
      {"constants", rules["constants"]},
      {"correlation", solution.correlation},
      {"history", solution.history},
      {"solver",
       {{"converged", solution.converged}, {"iterations", solution.iterations}, {"termination", solution.termination}}},
      {"trees", tree_rows},
      {"conclusion", conclusion},
      {"provenance", provenance}};
  const auto write = [&](const char* name, const std::string& text) { folder.write(name, text); };
  write("substrate_rules.json", rules.dump(2) + "\n");
  write("result.json", document.dump(2) + "\n");
  write("result.md", rules_page(recipe, solution, scores, mixes, trees, budget_scores, conclusion, context.command));
  for (const std::string& language : shader_languages()) {
    write(("substrate_rules." + language).c_str(), rules_shader(language, constants, context.command));
  }
  for (const char* name : {"trees.svg", "trees.png"}) {
    write_figure(trees_figure(budget_scores), folder.path(name), true, {.width = 800, .height = 520});
  }
  folder.commit();
  if (context.json) {
    std::cout << document.dump(2) << "\n";
    return;
  }
  fmt::print("  {:<10} {:<16} {:>22} {:>22} {:>22}\n", "bottom", "medium", "baseline", "tree", "fitted");
  for (const RuleScore& score : scores) {
    if (score.interface != "all") continue;
    fmt::print("  {:<10} {:<16} {:>22} {:>22} {:>22}\n", score.bottom, score.medium, quantiles_text(score.baseline),
               quantiles_text(score.tree), quantiles_text(score.fitted));
  }
  fmt::print("\n  {:>5} {:>6} {:>9} {:>9} {:>13} {:>6}\n", "bytes", "trees", "baseline", "fitted", "error-driven",
             "ratio");
  for (const BudgetScore& score : budget_scores) {
    fmt::print("  {:>5} {:>6} {:>9.4f} {:>9.4f} {:>13.4f} {:>6.2f}\n", score.bytes, score.trees, score.baseline,
               score.fitted, score.error_driven, score.ratio);
  }
  fmt::print("\n{}\n\nWritten to {}: result.md, result.json, substrate_rules.json, tables and figures.\n", conclusion,
             destination.string());
}

}  // namespace lobefit
