#include "evaluate/substrate_shader.h"

#include <vector>

#include "evaluate/shader_printer.h"

namespace lobefit {

namespace {

using TracedSlab = Slab::Parameters<Expression>;

const std::string slab_type = "Lobefit_slab_Parameters";
const std::string constants_type = "Lobefit_BlendConstants";
const std::string constants_function = "Lobefit_Blend_Fitted";

template <class Member>
Member input(const std::string& name) {
  return Member(Trace::current().node(Operation::input, traced::type_of<Member>, {}, name));
}

/// The members of a struct that is called `variable`.
TracedSlab slab_input(const std::string& variable) {
  TracedSlab slab;
  Slab::describe(slab, [&](auto& member, const ParameterInfo& info) {
    member = input<std::remove_cvref_t<decltype(member)>>(variable + "." + std::string(info.name));
  });
  return slab;
}

/// A function from slabs and numbers to a slab.
struct BlendFunction {
  std::string name, comment;
  std::vector<std::string> slabs, numbers;
  TracedSlab result;
};

std::string function_text(const ShaderLanguage& language, BlendFunction& function) {
  std::string arguments;
  std::vector<std::string> taken{"c"};
  const auto add = [&](const std::string& type, const std::string& name) {
    arguments += (arguments.empty() ? "" : ", ") + argument_text(language, type, name);
    taken.push_back(name);
  };
  for (const std::string& slab : function.slabs) add(slab_type, slab);
  for (const std::string& number : function.numbers) add(std::string(language.scalar), number);

  std::vector<std::string> names;
  std::vector<const ShaderNode*> results;
  Slab::describe(function.result, [&](const auto& member, const ParameterInfo& info) {
    names.emplace_back(info.name);
    results.push_back(member.node);
  });
  const StatementPrinter printer(language, results, taken);
  std::string text = "// " + function.comment + "\n" + function_head(language, slab_type, function.name, arguments) +
                     local_text(language, constants_type, "c", constants_function + "()") + printer.statements() +
                     variable_text(language, slab_type, "p");
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += "    p." + names[i] + " = " + printer.text(*results[i]) + ";\n";
  }
  return text + "    return p;\n}\n";
}

}  // namespace

std::string blend_shader(std::string_view language_name, const FittedBlend::Constants<double>& constants,
                         std::span<const std::string> provenance) {
  const ShaderLanguage& language = find_shader_language(language_name);
  std::vector<ShaderParameter> members;
  for (const ParameterInfo& info : describe_parameters<Slab>()) members.push_back({info, {}, ""});
  std::vector<ShaderParameter> values;
  FittedBlend::describe(constants, [&](const double& value, const ParameterInfo& info) {
    values.push_back({info, {value}, ""});
  });

  Trace trace;
  FittedBlend::Constants<Expression> c;
  FittedBlend::describe(c, [](Expression& member, const ParameterInfo& info) {
    member = input<Expression>("c." + std::string(info.name));
  });
  const TracedSlab top = slab_input("top"), bottom = slab_input("bottom");
  const TracedSlab background = slab_input("background"), foreground = slab_input("foreground");
  const Expression share = input<Expression>("foreground_share"), cosine = input<Expression>("cos_theta_o");
  std::array functions{
      BlendFunction{"Lobefit_BlendVertical",
                    "A slab on top of another, with one lobe.",
                    {"top", "bottom"},
                    {"cos_theta_o"},
                    FittedBlend::vertical(top, bottom, cosine, c)},
      BlendFunction{"Lobefit_BlendVerticalHaze",
                    "The same with two lobes: the top's, and the bottom's as the second.",
                    {"top", "bottom"},
                    {"cos_theta_o"},
                    FittedBlend::vertical<LobeMerge::both>(top, bottom, cosine, c)},
      BlendFunction{"Lobefit_BlendHorizontal",
                    "Two slabs side by side, with one lobe; foreground_share from 0 to 1.",
                    {"background", "foreground"},
                    {"foreground_share", "cos_theta_o"},
                    FittedBlend::horizontal(background, foreground, share, cosine, c)},
      BlendFunction{"Lobefit_BlendHorizontalHaze",
                    "The same with two lobes: the background's, and the foreground's as the second.",
                    {"background", "foreground"},
                    {"foreground_share", "cos_theta_o"},
                    FittedBlend::horizontal<LobeMerge::both>(background, foreground, share, cosine, c)}};
  const Shader shader = trace.finish({});

  std::string text = "// Two Substrate slabs as one, by fitted rules.\n";
  for (const std::string& line : provenance) text += "// " + line + "\n";
  text +=
      "// Slabs that are fully there: partial coverage is a horizontal blend with what lies below.\n"
      "// cos_theta_o: N.V; where no view is known, " +
      number_text(FittedBlend::mean_view) + ".\n\n";
  text += shader_prologue(language) + struct_text(language, slab_type, members) +
          struct_text(language, constants_type, values) + definitions_text(language, shader) +
          values_text(language, constants_type, constants_function, values);
  for (BlendFunction& function : functions) text += "\n" + function_text(language, function);
  return text;
}

}  // namespace lobefit
