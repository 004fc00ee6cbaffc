// Shader text from a traced model.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evaluate/expression.h"
#include "models/model.h"

namespace lobefit {

/// Languages that print_shader() writes: "hlsl" (Shader Model 5 style), "glsl" (4.50), "c" (C99,
/// which C++ reads too), "wgsl". Texts of several models may be joined into one, but in C not that of a term with those
/// of the models that call it, and in WGSL, which has no preprocessor, none.
std::vector<std::string> shader_languages();

/// One parameter's value in the printed Fitted() function.
struct ShaderParameter {
  ParameterInfo info;
  std::vector<double> value;  // 1 or 3 components
  std::string comment;        // such as its 95 % interval; may be empty
};

/// The shader's text: parameter struct, helper functions, Lobefit_NAME(wi, wo, p) and Lobefit_NAME_Fitted().
/// `provenance` are the lines of its head comment. Throws Error(usage) for an unknown language.
std::string print_shader(const Shader& shader, std::string_view language, const ModelInfo& model,
                         std::span<const ShaderParameter> parameters, std::span<const std::string> provenance);

/// Traces evaluate_brdf<M> on wi, wo and the members of a parameter struct p.
template <class M>
Shader trace_shader() {
  Trace trace(M::info.name);
  const auto input = [&](const std::string& name, ShaderType type) {
    return trace.node(Operation::input, type, {}, name);
  };
  typename M::template Parameters<Expression> p;
  M::describe(p, [&](auto& member, const ParameterInfo& info) {
    using Member = std::remove_cvref_t<decltype(member)>;
    member = Member(input("p." + std::string(info.name), traced::type_of<Member>));
  });
  const Vec3<Expression> wi(input("wi", ShaderType::vector)), wo(input("wo", ShaderType::vector));
  const Vec3<Expression> brdf = evaluate_brdf<M>(p, wi, wo);
  return trace.finish({std::string(M::info.name), {{"wi", ShaderType::vector}, {"wo", ShaderType::vector}}, brdf.node});
}

}  // namespace lobefit
