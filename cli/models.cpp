// lobefit models, lobefit references: what there is, and its parameters.
#include <fmt/format.h>

#include <iostream>

#include "cli/arguments.h"
#include "evaluate/description.h"
#include "evaluate/float_model.h"
#include "evaluate/operation_cost.h"

namespace lobefit {

namespace {

void print_parameters(const std::vector<ParameterInfo>& parameters) {
  fmt::print("\n  {:<22} {:<6} {:<20} {:<9} {:<9} {}\n", "parameter", "symbol", "range", "default", "tier", "meaning");
  for (const ParameterInfo& info : parameters) {
    std::string range, initial;
    if (info.choices.empty()) {
      range = fmt::format("{:g} … {:g}{}{}", info.lower, info.upper, info.unit.empty() ? "" : " ", info.unit);
      initial = fmt::format("{:g}", info.initial);
    } else {
      for (const std::string_view choice : info.choices) range += (range.empty() ? "" : "|") + std::string(choice);
      initial = info.choices[static_cast<std::size_t>(info.initial)];
    }
    fmt::print("  {:<22} {:<6} {:<20} {:<9} {:<9} {}{}\n", info.name, info.symbol, range, initial, tier_name(info.tier),
               info.doc, info.components == 3 ? " (r,g,b or one number)" : "");
  }
}

/// Callisto's table of tiers (slide 98), for models that have more than one.
void print_tiers(const std::vector<ParameterInfo>& parameters) {
  constexpr std::array audiences{"for everyone", "for technical and material artists", "for fitting by machine"};
  std::array<std::string, audiences.size()> names;
  for (const ParameterInfo& info : parameters) {
    std::string& list = names[static_cast<std::size_t>(info.tier)];
    list += (list.empty() ? "" : ", ") + std::string(info.name);
  }
  if (std::ranges::count(names, "") > 1) return;
  fmt::print("\n");
  for (const Tier tier : {Tier::base, Tier::advanced, Tier::full}) {
    const auto i = static_cast<std::size_t>(tier);
    if (!names[i].empty()) fmt::print("  {:<9} {:<35} {}\n", tier_name(tier), audiences[i], names[i]);
  }
  fmt::print("  `lobefit fit --tier TIER` frees a tier and those before it.\n");
}

void print_model(const Model& model) {
  const ModelInfo& info = *model.info;
  const OperationCount operations = count_operations(find_float_model(info.name).trace());
  fmt::print("{}: {}\n  {}\n  Source: {}\n", info.name, info.title, info.doc, info.source);
  fmt::print("  {}, {}{}, {}{}{}\n", info.reciprocal ? "reciprocal" : "not reciprocal",
             is_term(info.kind)       ? ""
             : info.energy_conserving ? "energy conserving, "
                                      : "can reflect more than it receives, ",
             info.isotropic ? "isotropic" : "anisotropic", info.non_negative ? "never negative" : "can be negative",
             info.transmits ? ", for light from behind too" : "",
             model.sample ? ", has its own importance sampling" : "");
  if (info.kind == ModelKind::term) fmt::print("  A term: evaluated at the half vector of wi and wo, one number.\n");
  if (info.kind == ModelKind::hair_term) fmt::print("  A term of hair: z is the fibre's axis; one number.\n");
  fmt::print(
      "  Cost: {} scalar operations ({} add/multiply, {} divide, {} square root, {} transcendental, {} "
      "compare/select{})\n"
      "        about {} cycles of full-rate arithmetic, if roots and transcendentals run at a quarter of the rate, "
      "divisions at a fifth, and nothing is fused\n",
      operations.total(), operations.add_multiply, operations.divide, operations.square_root, operations.transcendental,
      operations.compare_select, operations.table_read > 0 ? fmt::format(", {} table read", operations.table_read) : "",
      alu_cycles(operations));
  print_parameters(model.parameters);
  print_tiers(model.parameters);
}

/// All models of one kind, if there are any.
void print_list(ModelKind kind, std::string_view heading) {
  bool first = true;
  for (const Model& model : models()) {
    if (model.info->kind != kind) continue;
    if (first) fmt::print("  {:<22} {:<67} {}\n", heading, "title", "parameters");
    first = false;
    std::string parameters;
    for (const ParameterInfo& info : model.parameters)
      parameters += (parameters.empty() ? "" : " ") + std::string(info.name);
    fmt::print("  {:<22} {:<67} {}\n", model.info->name, model.info->title, parameters);
  }
  if (!first) fmt::print("\n");
}

}  // namespace

void add_models(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("models", "List models; for one: parameters, source, properties, cost");
  const auto name = std::make_shared<std::string>();
  verb->add_option("NAME", *name, "Model to describe");
  verb->callback([&context, name] {
    if (context.json) {
      Json list = Json::array();
      if (name->empty()) {
        for (const Model& model : models()) list.push_back(model_json(model));
      } else {
        list.push_back(model_json(find_model(*name)));
      }
      std::cout << Json{{"models", list}}.dump(2) << "\n";
    } else if (!name->empty()) {
      print_model(find_model(*name));
    } else {
      print_list(ModelKind::brdf, "model");
      print_list(ModelKind::hair, "hair model");
      print_list(ModelKind::term, "term");
      print_list(ModelKind::hair_term, "hair term");
      fmt::print("`lobefit models NAME` describes one.\n");
    }
  });
}

void add_references(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("references", "List the reference integrators; for one: its parameters");
  const auto name = std::make_shared<std::string>();
  verb->add_option("NAME", *name, "Reference to describe");
  verb->callback([&context, name] {
    std::vector<const Reference*> chosen;
    if (name->empty()) {
      for (const Reference& reference : references()) chosen.push_back(&reference);
    } else {
      chosen.push_back(&find_reference(*name));
    }
    Json list = Json::array();
    for (const Reference* reference : chosen) {
      if (context.json) {
        list.push_back(reference_json(*reference));
      } else {
        fmt::print("{}: {}\n  Source: {}\n", reference->name, reference->doc, reference->source);
        print_parameters(reference->parameters);
      }
    }
    if (context.json) std::cout << Json{{"references", list}}.dump(2) << "\n";
  });
}

}  // namespace lobefit
