// lobefit refit: a recipe from reference to result, with figures, checks and shaders.
#include <fmt/format.h>

#include <chrono>
#include <iostream>
#include <set>

#include "cli/arguments.h"
#include "cli/constants_page.h"
#include "cli/output_folder.h"
#include "cli/refit_approximations.h"
#include "cli/refit_curves.h"
#include "cli/substrate_rules.h"
#include "evaluate/check.h"
#include "evaluate/shader.h"
#include "fit/forms.h"
#include "fit/recipe.h"
#include "reference/output_file.h"
#include "reference/targets.h"
#include "report/figure.h"
#include "report/fit_text.h"
#include "report/shader_text.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

fs::path recipe_folder() { return data_folder() / "recipes"; }

std::vector<std::string> shipped_recipes() {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& file : fs::directory_iterator(recipe_folder(), ignored)) {
    if (file.path().extension() == ".json") names.push_back(file.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

fs::path find_recipe(const std::string& name) {
  std::error_code ignored;
  if (fs::is_regular_file(name, ignored)) return name;
  const fs::path shipped = recipe_folder() / (name + ".json");
  if (fs::is_regular_file(shipped, ignored)) return shipped;
  const std::vector<std::string> names = shipped_recipes();
  throw Error(ExitCode::usage, "unknown recipe '" + name + "'", "",
              "did you mean '" + nearest_name(name, names) + "'? A recipe of your own is given by its path");
}

/// File name of a fit: row, method and free parameters.
std::string stem(const RecipeResultRow& line) {
  std::string free;
  for (const std::string& name : line.free) free += "-" + name;
  return line.row->name + "." + line.method + free;
}

/// The result as a Markdown page.
std::string result_page(const Recipe& recipe, const RecipeResult& result, const std::string& command) {
  std::string page = "# " + recipe.title + "\n\n" + recipe.description + "\n\n**" + result.conclusion + "**\n\n";
  page += "Made by `" + command +
          "`, lobefit " LOBEFIT_VERSION ". Intervals are 95 %, from the Monte Carlo error of the reference.\n\n";
  page += "| row | method |";
  std::vector<std::string> names;
  for (const auto& [name, value] : recipe.published) names.push_back(name);
  for (const std::string& name : names) page += " " + name + " |";
  page += " rms published | rms refit |";
  for (const Rival& rival : recipe.rivals) page += " " + rival.label + " |";
  page += "\n|---|---|";
  for (std::size_t i = 0; i < names.size() + 2 + recipe.rivals.size(); ++i) page += "---|";
  page += "\n";
  for (const RecipeResultRow& line : result.rows) {
    page += "| " + line.row->name + " | " + line.method + " |";
    for (const std::string& name : names) {
      std::string cell = "";
      for (const FitParameter& p : line.fit.parameters) {
        if (p.name == name) cell = p.free ? interval_text(p) : fmt::format("({:g})", p.estimate.value);
      }
      page += " " + cell + " |";
    }
    page += fmt::format(" {:.4f} | {:.4f} |", line.rms_published, line.rms_refit);
    for (const RivalScore& rival : line.rivals) page += fmt::format(" {:.3f} |", rival.rms);
    page += "\n";
  }
  page += "\nConstants in parentheses were held. rms is that of the row's own metric and weights.\n";
  return page;
}

void print_result(const RecipeResult& result) {
  fmt::print("  {:<36} {:<12} {:<52} {:>9} {:>8}\n", "row", "method", "constants", "published", "refit");
  for (const RecipeResultRow& line : result.rows) {
    std::string constants;
    for (const FitParameter& p : line.fit.parameters) {
      if (!p.free) continue;
      constants += fmt::format("{}{} {:.4f}{}", constants.empty() ? "" : "  ", p.name, p.estimate.value,
                               !p.estimate.identifiable ? " (no effect)"
                               : p.estimate.at_bound    ? " (bound)"
                                                        : "");
    }
    fmt::print("  {:<36} {:<12} {:<52} {:>9.4f} {:>8.4f}\n", line.row->name, line.method, constants, line.rms_published,
               line.rms_refit);
  }
  fmt::print("\n{}\n", result.conclusion);
}

/// The lines of a figure: published, refit and the rivals, best first, as far as they can be told apart.
std::vector<LabelledTable> labelled(const RecipeResult& result, const RecipeResultRow& line, std::size_t most) {
  const Table& table = result.tables[line.table].table;
  std::vector<LabelledTable> tables{{"published", table.with_values("published", line.published_values)},
                                    {"refit", table.with_values("refit", line.refit_values)}};
  std::vector<const RivalScore*> rivals;
  for (const RivalScore& rival : line.rivals) rivals.push_back(&rival);
  std::ranges::sort(rivals, {}, [](const RivalScore* rival) { return rival->rms; });
  for (const RivalScore* rival : rivals) {
    if (tables.size() < most) tables.push_back({rival->label, table.with_values(rival->label, rival->values)});
  }
  return tables;
}

void write_figures(const RecipeResult& result, const OutputFolder& folder) {
  std::set<std::string> drawn;
  for (const RecipeResultRow& line : result.rows) {
    if (line.method != "monte_carlo" || !drawn.insert(line.row->name).second) continue;
    const Table& table = result.tables[line.table].table;
    const std::vector<LabelledTable> lines = labelled(result, line, 6);
    const auto write = [&](const std::string& kind, const std::string& program, const FigureSize& size) {
      for (const char* extension : {".svg", ".png"}) {
        write_figure(program, folder.path(line.row->name + "." + kind + extension), true, size);
      }
    };
    write("slices", slice_figure(table, lines, {}, line.row->name), slice_figure_size(table, {}));
    if (table.grid.theta_o.size() > 1) {
      const std::vector<double>& phi = table.grid.phi.values;
      const SliceChoice oblique{.theta_o = table.grid.theta_o.size() * 2 / 3,
                                .both_sides = phi.front() == 0.0 && phi.back() == 180.0};
      write("slices_oblique", slice_figure(table, lines, oblique, line.row->name), slice_figure_size(table, oblique));
      const std::vector<LabelledTable> few = labelled(result, line, 4);
      for (const bool retro : {true, false}) {
        const SliceChoice side{.phi = retro ? 0 : table.grid.phi.size() - 1};
        write(retro ? "residuals_retro" : "residuals_mirror", residual_figure(table, few, side, line.row->name),
              residual_figure_size(table, few.size(), side));
      }
    }
  }
}

/// Every fitted model in float against double; the JSON list for the result. False if one fails.
bool check_fits(const RecipeResult& result, const Context& context, Monitor& monitor, Json& list) {
  bool passed = true;
  for (const RecipeResultRow& line : result.rows) {
    if (line.method != "exact") continue;
    const Table& table = result.tables[line.table].table;
    const TableModel on_table(find_model(line.row->model), line.fit.values(), table);
    // The parameter sets of the table's rows: what the fit is for.
    std::vector<ParameterValues> sets;
    for (std::size_t row = 0; row < table.parameter_rows(); ++row) {
      ParameterValues set = line.fit.values();
      std::ranges::copy(on_table.row(row), set.flat().begin());
      sets.push_back(std::move(set));
    }
    CheckResult check = check_model(on_table.model(), sets, {.seed = context.seed}, SimdDevice(), monitor);
    check.table = check_against_table(on_table, table, SimdDevice());
    Json document = check.json();
    // A rate is not a result: the same run gives the same file.
    document.erase("evaluations_per_s");
    list.push_back({{"row", line.row->name}, {"free", line.free}, {"check", document}});
    passed = passed && check.passed;
  }
  return passed;
}

void refit_constants(const fs::path& path, const std::string& output, const Context& context) {
  const Recipe recipe = Recipe::read(path);
  OutputFolder folder(output.empty() ? fs::path("out") / recipe.name : fs::path(output), context.force);
  const auto monitor = context.monitor();
  RecipeResult result = run_recipe(recipe, context.seed, *monitor);

  std::vector<std::string> hashes;
  for (RecipeTable& table : result.tables) {
    monitor->check();
    table.table.command = context.command;
    table.table.write(folder.path(table.name + ".exr"));
    hashes.push_back(sha256_of_file(folder.path(table.name + ".exr")));
  }
  for (const RecipeResultRow& line : result.rows) {
    folder.write(stem(line) + ".fit.json", line.fit.json(context.command, hashes[line.table]).dump(2) + "\n");
  }
  // The shader of each row's first set of constants, in each language.
  for (const RecipeResultRow& line : result.rows) {
    if (line.method != "monte_carlo" || line.free != line.row->free_sets.front()) continue;
    for (const std::string& language : shader_languages()) {
      folder.write(line.row->name + "." + language,
                   shader_text(find_model(line.row->model), line.fit.values(), &line.fit, language, context.command,
                               "Constants of row " + line.row->name));
    }
  }
  monitor->check();
  write_figures(result, folder);

  Json document = result.json(recipe, context.command, context.seed);
  Json checks = Json::array();
  const bool passed = check_fits(result, context, *monitor, checks);
  document["checks"] = checks;
  folder.write("result.md", result_page(recipe, result, context.command));
  folder.write("result.json", document.dump(2) + "\n");
  folder.commit();

  if (context.json) {
    std::cout << document.dump(2) << "\n";
  } else {
    print_result(result);
    fmt::print("\nWritten to {}: result.json, result.md, tables, fits, shaders and figures; open {}\n",
               folder.destination().string(),
               (folder.destination() / (recipe.rows.front().name + ".slices.png")).string());
  }
  if (!passed) {
    throw Error(ExitCode::check_failed, "a fitted model in float strays from double precision",
                folder.destination().string(), "see \"checks\" in result.json");
  }
}

void run(const std::string& name, const std::string& output, bool resume, const Context& context) {
  const fs::path path = find_recipe(name);
  switch (recipe_kind(path)) {
    case RecipeKind::constants: return refit_constants(path, output, context);
    case RecipeKind::curves: return refit_curves(path, output, context);
    case RecipeKind::substrate_rules: return refit_substrate_rules(path, output, resume, context);
    case RecipeKind::approximations: return refit_approximations(path, output, context);
  }
}

/// Every shipped recipe into a folder of its own, and a page of all constants.
void run_all(const fs::path& folder, bool resume, const Context& context) {
  std::vector<RecipeOutcome> outcomes;
  for (const std::string& recipe : shipped_recipes()) {
    run(recipe, (folder / recipe).string(), resume, context);
    const fs::path result = folder / recipe / "result.json";
    outcomes.push_back({recipe, recipe, parse_json(read_file(result), result.string())});
  }
  OutputFile page(folder / "constants.md", true);
  page.write(constants_page(outcomes, context.command));
  page.commit();
  context.say(fmt::format("every constant on one page: {}", (folder / "constants.md").string()));
}

Json forms_json() {
  Json list = Json::array(), targets_list = Json::array();
  for (const Form& form : forms()) {
    Json constants = Json::array();
    for (const FormConstant& constant : form.constants) {
      constants.push_back(
          {{"name", constant.name}, {"value", constant.initial}, {"lower", constant.lower}, {"upper", constant.upper}});
    }
    list.push_back({{"name", form.name},
                    {"title", form.title},
                    {"formula", form.formula},
                    {"source", form.source},
                    {"arguments", form.arguments},
                    {"constants", constants}});
  }
  for (const Target& target : targets()) {
    Json arguments = Json::array();
    for (const ParameterInfo& info : target.arguments) {
      arguments.push_back(
          {{"name", info.name}, {"lower", info.lower}, {"upper", info.upper}, {"default", info.initial}});
    }
    targets_list.push_back({{"name", target.name},
                            {"title", target.title},
                            {"source", target.source},
                            {"arguments", arguments},
                            {"derived", target.derived_names}});
  }
  return {{"forms", list}, {"targets", targets_list}};
}

/// What recipes of closed forms can name.
void list_forms(const Context& context) {
  if (context.json) {
    std::cout << forms_json().dump(2) << "\n";
    return;
  }
  fmt::print("Closed forms (their constants start as published):\n");
  for (const Form& form : forms()) {
    fmt::print("  {:<34} {}\n  {:<34} {}\n  {:<34} of {}\n", form.name, form.title, "", form.formula, "",
               fmt::join(form.arguments, ", "));
  }
  fmt::print("\nTargets, the exact functions that they stand for:\n");
  for (const Target& target : targets()) {
    std::string arguments;
    for (const ParameterInfo& info : target.arguments) {
      arguments += fmt::format("{}{} {:g} … {:g}", arguments.empty() ? "" : ", ", info.name, info.lower, info.upper);
    }
    if (!target.derived_names.empty()) {
      arguments += fmt::format("; from them {}", fmt::join(target.derived_names, ", "));
    }
    fmt::print("  {:<34} {}\n  {:<34} of {}\n", target.name, target.title, "", arguments);
  }
}

}  // namespace

void add_refit(CLI::App& app, Context& context) {
  std::string shipped;
  for (const std::string& name : shipped_recipes()) shipped += (shipped.empty() ? "" : ", ") + name;
  CLI::App* verb = app.add_subcommand("refit",
                                      "Run a recipe end to end: render its references, fit, check, draw, export\n"
                                      "  lobefit refit proxima -o out/proxima\n"
                                      "  lobefit refit my_recipe.json\n"
                                      "Shipped recipes: " +
                                          shipped);
  struct Arguments {
    std::string name, output;
    bool all = false, resume = false, forms = false;
  };
  const auto a = std::make_shared<Arguments>();
  auto* name = verb->add_option("RECIPE", a->name, "Shipped recipe or JSON file");
  auto* all = verb->add_flag("--all", a->all, "Every shipped recipe");
  name->excludes(all);
  verb->add_flag("--forms", a->forms, "List the closed forms and exact functions that recipes of forms can name")
      ->excludes(name)
      ->excludes(all);
  verb->add_option("-o,--output", a->output,
                   "Folder for the results (default: out/RECIPE; with --all out, and a page of all constants)");
  verb->add_flag("--resume", a->resume, "Go on with the tables that an interrupted run kept (substrate-rules)");
  verb->callback([&context, a] {
    if (a->forms) return list_forms(context);
    if (a->name.empty() && !a->all) {
      throw Error(ExitCode::usage, "refit what?", "refit", "name a recipe, or use --all");
    }
    if (!a->all) {
      run(a->name, a->output, a->resume, context);
      return;
    }
    run_all(a->output.empty() ? fs::path("out") : fs::path(a->output), a->resume, context);
  });
}

}  // namespace lobefit
