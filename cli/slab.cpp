// lobefit slab: Substrate trees, what they store, and what simplifying them costs.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "cli/output_folder.h"
#include "cli/substrate_rules.h"
#include "evaluate/shader.h"
#include "evaluate/substrate_storage_error.h"
#include "fit/substrate_rules.h"
#include "models/substrate/regime.h"
#include "reference/output_file.h"
#include "reference/substrate/tree_albedo.h"
#include "reference/substrate/tree_json.h"
#include "report/figure.h"
#include "report/shader_text.h"
#include "report/slab_validation.h"
#include "report/tree_figure.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

constexpr const char* tree_doc = "Substrate tree, a JSON file, or the name of a shipped one (data/substrate)";

/// A file, or a shipped tree by name.
fs::path find_tree(const std::string& name) {
  std::error_code ignored;
  if (fs::is_regular_file(name, ignored)) return name;
  const fs::path folder = data_folder() / "substrate";
  const fs::path shipped = folder / (name + ".json");
  if (fs::is_regular_file(shipped, ignored)) return shipped;
  if (is_file(name)) throw Error(ExitCode::invalid_input, "cannot read the Substrate tree", name, "check the path");
  std::vector<std::string> names;
  for (const auto& file : fs::directory_iterator(folder, ignored)) names.push_back(file.path().stem().string());
  throw Error(ExitCode::usage, "no shipped tree is named '" + name + "'", "TREE",
              "did you mean '" + nearest_name(name, names) + "'? A tree of your own is given by its path");
}

Json storage_json(const std::vector<Closure>& closures) {
  const MaterialStorage storage = material_storage(stored_features(closures));
  Json fields = Json::array();
  for (const StoredField& stored : storage.fields) {
    fields.push_back({{"part", storage_part_names[static_cast<std::size_t>(stored.field->part)]},
                      {"name", stored.field->name},
                      {"closure", stored.closure},
                      {"bits", stored.field->bit_count()}});
  }
  return {{"bytes", storage.bytes()},
          {"medium_bytes", storage.medium_bytes()},
          {"layout", storage_layout_names[static_cast<std::size_t>(storage.layout)]},
          {"padding_bits", storage.padding_bits},
          {"fields", fields}};
}

Json closure_json(const Closure& closure, const Direction& wo) {
  const Rgb view = closure.view_throughput(wo.z), above = closure.light_above.transmittance;
  return {{"path", closure.path},
          {"name", closure.name},
          {"weight", closure.weight},
          {"view_throughput", {view.x, view.y, view.z}},
          {"top_coverage", closure.light_above.coverage},
          {"top_transmittance", {above.x, above.y, above.z}},
          {"slab", slab_json(closure.slab)}};
}

void print_packed(const std::vector<Closure>& closures) {
  const std::vector<StoredClosure> stored = stored_closures(closures, FittedBlend::mean_view);
  const PackedMaterial packed = pack_material(stored);
  fmt::print("\nPacked into {} words{}\n", packed.words.size(),
             packed.storage.medium_words > 0 ? fmt::format(", {} of them of media", packed.storage.medium_words) : "");
  Table table;
  table.grid = Grid::named_or_file("small");
  table.channels = 3;
  table.allocate();
  const SubstrateStorageError error = substrate_storage_error(stored, unpack_material(packed.words).closures, table,
                                                              entry_weights(table, {}, Quantity::log));
  fmt::print("  quantisation: rms {:.2g} of log(1 + f cos)\n", error.total[static_cast<std::size_t>(Quantity::log)]);
  for (std::size_t i = 0; i < std::min<std::size_t>(3, error.alone.size()); ++i) {
    fmt::print("    {:.2g} from {} of closure {}\n", error.alone[i].rms, error.alone[i].field, error.alone[i].closure);
  }
  for (const StorageLoss& loss : packed.losses) {
    fmt::print("  closure {}, {}: {}\n", loss.closure, loss.parameter, loss.words);
  }
  for (const std::string& words : not_stored()) fmt::print("  never stored: {}\n", words);
}

void add_show(CLI::App& slab, Context& context) {
  CLI::App* verb = slab.add_subcommand("show", "Topology, closures and bytes of a tree");
  struct Arguments {
    std::string tree, svg;
    bool fields = false, packed = false;
    double pixel = 0.1;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("TREE", a->tree, tree_doc)->required();
  verb->add_option("--svg", a->svg, "Draw the topology into this file");
  verb->add_flag("--fields", a->fields, "List every stored field with its bits");
  verb->add_flag("--packed", a->packed, "Pack the closures, and tell what quantisation does to the BRDF");
  verb->add_option("--pixel", a->pixel, "Width that a pixel covers, cm: it decides how media are shaded")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  verb->callback([&context, a] {
    const fs::path path = find_tree(a->tree);
    const SlabTree tree = read_tree(path);
    const std::vector<Closure> closures = walk(tree);
    const Json storage = closures.empty() ? Json{{"bytes", 4}} : storage_json(closures);
    if (!a->svg.empty()) {
      OutputFile file(a->svg, context.force);
      file.write(tree_svg(tree, tree.title));
      file.commit();
    }
    if (context.json) {
      Json list = Json::array();
      for (const Closure& closure : closures) list.push_back(closure_json(closure, {0.0, 0.0, 1.0}));
      std::cout << Json{{"tree", tree_json(tree)}, {"closures", list}, {"storage", storage}}.dump(2) << "\n";
      return;
    }
    fmt::print("{}\n{}\n", tree.title, tree_text(tree));
    fmt::print("{} closures, {} bytes per pixel{}\n", closures.size(), storage["bytes"].get<int>(),
               closures.empty() ? "" : ", layout " + storage["layout"].get<std::string>());
    WalkOptions exact;
    exact.exact_statistics = true;
    const std::size_t all = walk(tree, exact).size();
    if (all > closures.size()) fmt::print("(exact statistics of all coverage events: {} closures)\n", all);
    fmt::print("\nMedia, for pixels {:g} cm wide:\n", a->pixel);
    for (const SlabRegime& slab_regime : regimes_of(tree, a->pixel)) {
      fmt::print("  {:<28} {}\n", slab_regime.name, regime_names[static_cast<std::size_t>(slab_regime.regime)]);
    }
    if (a->packed) print_packed(closures);
    if (!a->fields || closures.empty()) return;
    for (const Json& field : storage["fields"]) {
      const int closure = field["closure"];
      fmt::print("  {:<18} {:<26} {:>3} bits\n", field["part"].get<std::string>(),
                 field["name"].get<std::string>() + (closure < 0 ? "" : fmt::format(" of closure {}", closure)),
                 field["bits"].get<int>());
    }
    if (storage["padding_bits"].get<int>() > 0) {
      fmt::print("  {:<45} {:>3} bits\n", "padding", storage["padding_bits"].get<int>());
    }
  });
}

void add_slab_eval(CLI::App& slab, Context& context) {
  CLI::App* verb = slab.add_subcommand("eval", "BRDF of a tree, 1/sr without cosine, or its directional albedo");
  struct Arguments {
    std::string tree;
    std::vector<std::string> wi, wo;
    bool exact = false, closures = false, untracked = false;
    double theta = -1.0;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("TREE", a->tree, tree_doc)->required();
  add_repeatable(*verb, "--wi", a->wi, "Light: THETA,PHI in degrees (repeatable)");
  add_repeatable(*verb, "--wo", a->wo, "Viewer: THETA,PHI in degrees (repeatable)");
  verb->add_option("--albedo", a->theta, "Directional albedo for a viewer at this polar angle, degrees")
      ->check(CLI::Range(0.0, 89.9));
  verb->add_flag("--exact-statistics", a->exact, "All coverage events apart, in place of one virtual slab above each");
  verb->add_flag("--no-roughness-tracking", a->untracked, "Layers above do not blur those below");
  verb->add_flag("--closures", a->closures, "Each closure's share too, and what a path tracer risks that chooses one");
  verb->callback([&context, a] {
    const SlabTree tree = read_tree(find_tree(a->tree));
    const std::vector<Closure> closures =
        walk(tree, {.roughness_tracking = !a->untracked, .exact_statistics = a->exact});
    if (a->wi.size() != a->wo.size() || (a->wi.empty() && a->theta < 0.0)) {
      throw Error(ExitCode::usage,
                  fmt::format("{} directions to the light, {} to the viewer", a->wi.size(), a->wo.size()), "slab eval",
                  "give --wi and --wo in pairs, or --albedo THETA");
    }
    Json values = Json::array(), document = Json::object();
    for (std::size_t i = 0; i < a->wi.size(); ++i) {
      const Direction wi = parse_direction(a->wi[i], "--wi"), wo = parse_direction(a->wo[i], "--wo");
      const Rgb f = evaluate(closures, wi, wo);
      Json value{
          {"wi", parse_numbers(a->wi[i], "--wi")}, {"wo", parse_numbers(a->wo[i], "--wo")}, {"f", rgb_json(f, 3)}};
      if (!context.json) fmt::print("{}\n", rgb_text(f, 3));
      if (a->closures) {
        const ClosureSelection selection = ClosureSelection::of(closures, wo);
        for (std::size_t k = 0; k < closures.size(); ++k) {
          const Closure& closure = closures[k];
          const Rgb share = closure.evaluate(wi, wo);
          value["closures"].push_back({{"path", closure.path},
                                       {"name", closure.name},
                                       {"f", rgb_json(share, 3)},
                                       {"probability", selection.probabilities[k]}});
          if (!context.json) {
            fmt::print("  {:<28} {}   chosen with probability {:.3f}\n",
                       closure.name.empty() ? closure.path : closure.name, rgb_text(share, 3),
                       selection.probabilities[k]);
          }
        }
        const Rgb variance = selection.variance(closures, wi, wo);
        value["selection_variance"] = rgb_json(variance, 3);
        if (!context.json) {
          fmt::print("  choosing one closure by albedo: standard deviation {:.3g}  {:.3g}  {:.3g} of f\n",
                     std::sqrt(std::max(variance.x, 0.0)) / std::max(f.x, 1e-12),
                     std::sqrt(std::max(variance.y, 0.0)) / std::max(f.y, 1e-12),
                     std::sqrt(std::max(variance.z, 0.0)) / std::max(f.z, 1e-12));
        }
      }
      values.push_back(value);
    }
    if (!values.empty()) document["values"] = values;
    if (a->theta >= 0.0) {
      const Rgb albedo = directional_albedo(closures, direction(radians(a->theta), 0.0));
      document["theta"] = a->theta;
      document["albedo"] = rgb_json(albedo, 3);
      if (!context.json) fmt::print("directional albedo at {:g} degrees: {}\n", a->theta, rgb_text(albedo, 3));
    }
    if (context.json) std::cout << document.dump(2) << "\n";
  });
}

struct RuleArguments {
  std::string rules, reading = "in_air";
};
void add_rule_options(CLI::App& verb, RuleArguments& a) {
  verb.add_option("--rules", a.rules, "Rule file (default: the shipped data/substrate_rules.json)");
  verb.add_option("--diffuse-reading", a.reading,
                  "What a diffuse albedo is of the layers as matter: seen in air through a smooth interface, or bare")
      ->check(CLI::IsMember({"in_air", "bare"}))
      ->capture_default_str();
}
RuleConstants rules_of(const RuleArguments& a) {
  return read_rules(a.rules.empty() ? shipped_rules() : std::filesystem::path(a.rules));
}
DiffuseReading reading_of(const RuleArguments& a) {
  return a.reading == "bare" ? DiffuseReading::bare : DiffuseReading::in_air;
}

void add_simplify(CLI::App& slab, Context& context) {
  CLI::App* verb = slab.add_subcommand(
      "simplify",
      "Collapse a tree until it fits a budget, and write the tree that is left\n"
      "Strategies: baseline and fitted collapse the deepest operator first, with those rules, and then turn features\n"
      "off; error_driven searches for the least error against the layers as matter. Fitted rules depend on the view;\n"
      "the tree written is that of --view.");
  struct Arguments : RuleArguments {
    std::string tree, strategy = "fitted", output;
    int bytes = 16, closures = 8;
    double view = 48.19;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("TREE", a->tree, tree_doc)->required();
  verb->add_option("--bytes", a->bytes, "Bytes per pixel at most")->check(CLI::Range(12, 1024))->capture_default_str();
  verb->add_option("--closures", a->closures, "Closures at most")->check(CLI::Range(1, 8))->capture_default_str();
  verb->add_option("--strategy", a->strategy, "Which way to go")
      ->check(CLI::IsMember({"baseline", "fitted", "error_driven"}))
      ->capture_default_str();
  verb->add_option("--view", a->view, "Polar angle of the view that the tree is stored for, degrees")
      ->check(CLI::Range(0.0, 89.0))
      ->capture_default_str();
  verb->add_option("-o,--output", a->output, "File for the tree (default: stdout)");
  add_rule_options(*verb, *a);
  verb->callback([&context, a] {
    const SlabTree tree = read_tree(find_tree(a->tree));
    const RuleConstants constants = rules_of(*a);
    std::vector<SimplifiedTree> stages;
    if (a->strategy == "error_driven") {
      const auto monitor = context.monitor();
      const TreeJudge judge(tree, constants, {.reading = reading_of(*a), .seed = context.seed, .spheres = false},
                            *monitor);
      stages = simplify_by_error(tree, constants, [&](std::span<const SimplifyStep> steps) {
        monitor->check();
        return judge.quick_error(steps);
      });
    } else {
      stages =
          simplify_deepest_first(tree, a->strategy == "fitted" ? BlendRule::fitted : BlendRule::baseline, constants);
    }
    const auto fits = std::find_if(stages.begin(), stages.end(), [&](const SimplifiedTree& stage) {
      return stage.bytes <= a->bytes && stage.closures <= static_cast<std::size_t>(a->closures);
    });
    if (fits == stages.end()) {
      throw Error(ExitCode::usage,
                  fmt::format("nothing of {} bytes and {} closures is left of this tree; the smallest has {} bytes",
                              a->bytes, a->closures, stages.back().bytes),
                  "--bytes", "raise the budget");
    }
    const SlabTree result = simplified(tree, fits->steps, {constants, std::cos(radians(a->view))});
    Json document = tree_json(result);
    Json steps = Json::array();
    for (const SimplifyStep& step : fits->steps) steps.push_back(step_text(tree, step));
    if (context.json) {
      std::cout
          << Json{{"tree", document}, {"steps", steps}, {"bytes", fits->bytes}, {"closures", fits->closures}}.dump(2)
          << "\n";
      return;
    }
    document["description"] = fmt::format("{} of {}, {} bytes: {}", a->strategy, a->tree, fits->bytes,
                                          steps.empty() ? "nothing had to go" : steps.dump());
    write_or_print(document.dump(2) + "\n", a->output, context.force);
    for (const Json& step : steps) context.say(step.get<std::string>());
    context.say(fmt::format("{} bytes, {} closures", fits->bytes, fits->closures));
  });
}

void add_validate(CLI::App& slab, Context& context) {
  CLI::App* verb = slab.add_subcommand(
      "validate",
      "What every stage of simplifying costs: bytes, closures, error against the full tree and against matter\n"
      "Written to the folder: validation.json, validation.md, error.svg and .png, tree.svg.");
  struct Arguments : RuleArguments {
    std::string tree, output;
    ValidationOptions options;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("TREE", a->tree, tree_doc)->required();
  verb->add_option("-o,--output", a->output, "Folder for the results (default: none is written)");
  verb->add_option("--samples", a->options.brdf_samples, "Of the layered integrator, per pair of directions")
      ->check(CLI::Range(32, 1 << 24))
      ->capture_default_str();
  add_rule_options(*verb, *a);
  verb->callback([&context, a] {
    const fs::path path = find_tree(a->tree);
    const SlabTree tree = read_tree(path);
    std::optional<OutputFolder> folder;
    if (!a->output.empty()) folder.emplace(a->output, context.force);
    a->options.reading = reading_of(*a);
    a->options.seed = context.seed;
    a->options.albedo_paths = 16 * a->options.brdf_samples;
    const auto monitor = context.monitor();
    const SlabValidation validation = validate_tree(tree, rules_of(*a), a->options, *monitor);
    const fs::path rules = a->rules.empty() ? shipped_rules() : fs::path(a->rules);
    const Json document = validation.json({{"version", LOBEFIT_VERSION},
                                           {"command", context.command},
                                           {"seed", context.seed},
                                           {"samples", a->options.brdf_samples},
                                           {"diffuse_reading", a->reading},
                                           {"tree_sha256", sha256_of_file(path)},
                                           {"rules_sha256", sha256_of_file(rules)}});
    if (folder) {
      const auto write = [&](const char* name, const std::string& text) {
        OutputFile file(folder->path(name), true);
        file.write(text);
        file.commit();
      };
      write("validation.json", document.dump(2) + "\n");
      write("validation.md", validation.page(tree.title, context.command));
      write("tree.svg", tree_svg(tree, tree.title));
      for (const char* name : {"error.svg", "error.png"}) {
        write_figure(validation.figure(tree.title), folder->path(name), true, {.width = 1000, .height = 520});
      }
      folder->commit();
    }
    if (context.json) {
      std::cout << document.dump(2) << "\n";
      return;
    }
    fmt::print("{}\n  {:<13} {:>5} {:>8}  {:>14}  {:>8}   (model: brdf, albedo; truth known to {:.2g})\n", tree.title,
               "strategy", "bytes", "closures", "simplification", "model", validation.truth_error);
    for (const ValidatedStrategy& strategy : validation.strategies) {
      for (const ValidatedStage& stage : strategy.stages) {
        fmt::print("  {:<13} {:>5} {:>8}  {:>14.4f}  {:>8.4f}   {:.4f} {:.4f}  {}\n", strategy.name, stage.stage.bytes,
                   stage.stage.closures, stage.simplification.error(), stage.model.error(), stage.model.brdf_rms_log,
                   stage.model.albedo_rms_relative,
                   stage.stage.steps.empty() ? "full tree" : step_text(tree, stage.stage.steps.back()));
      }
    }
    for (const std::string& note : validation.notes) fmt::print("  left out of matter: {}\n", note);
  });
}

void add_shader(CLI::App& slab, Context& context) {
  CLI::App* verb = slab.add_subcommand(
      "shader",
      "Shader code of the rules that make one slab of two\n"
      "Lobefit_BlendVertical, Lobefit_BlendHorizontal and the same with Haze, on the parameter struct of\n"
      "`lobefit export slab`; both texts may stand in one shader (in WGSL what both define is to be taken out of "
      "one).");
  struct Arguments {
    std::string language = "hlsl", rules, output;
  };
  const auto a = std::make_shared<Arguments>();
  verb->add_option("--lang", a->language, "Shader language")
      ->check(CLI::IsMember(shader_languages()))
      ->capture_default_str();
  verb->add_option("--rules", a->rules, "Rule file (default: the shipped data/substrate_rules.json)");
  verb->add_option("-o,--output", a->output, "File (default: stdout)");
  verb->callback([&context, a] {
    const RuleConstants constants = read_rules(a->rules.empty() ? shipped_rules() : fs::path(a->rules));
    write_or_print(rules_shader(a->language, constants, context.command), a->output, context.force);
  });
}

}  // namespace

void add_slab(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand(
      "slab",
      "Substrate trees: topology, closures, bytes; evaluation; collapse to a budget; what that costs\n"
      "  lobefit slab show car_paint --fields --svg car_paint.svg\n"
      "  lobefit slab eval my_tree.json --wi 30,0 --wo 30,180 --closures\n"
      "  lobefit slab simplify car_paint --bytes 20 --strategy error_driven -o small.json\n"
      "  lobefit slab validate car_paint -o out/car_paint\n"
      "The layers as matter: `lobefit reference layered --set stack=TREE.json`.");
  verb->require_subcommand(1);
  add_show(*verb, context);
  add_slab_eval(*verb, context);
  add_simplify(*verb, context);
  add_validate(*verb, context);
  add_shader(*verb, context);
  for (CLI::App* part : verb->get_subcommands([](const CLI::App*) { return true; })) {
    part->fallthrough();
    const std::string description = part->get_description();
    const std::size_t line = description.find('\n');
    if (line == std::string::npos) continue;
    part->description(description.substr(0, line));
    part->footer("\n" + description.substr(line + 1));
  }
}

}  // namespace lobefit
