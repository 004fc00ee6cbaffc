#include "evaluate/form_shader.h"

#include <fmt/format.h>

#include <algorithm>

#include "evaluate/shader_printer.h"
#include "evaluate/single.h"
#include "models/approximations/list.h"

namespace lobefit {

namespace {

template <class F, class T>
T evaluate_on(std::span<const T> constants, std::span<const T> arguments) {
  std::array<T, F::constants.size()> c;
  std::array<T, F::arguments.size()> x;
  std::copy_n(constants.begin(), c.size(), c.begin());
  std::copy_n(arguments.begin(), x.size(), x.begin());
  return F::template evaluate<T>(c, x);
}

/// Runs `with` on the type of the form of this name.
template <class With>
void find_form_type(std::string_view name, With&& with) {
  bool found = false;
  const auto look = [&]<class F>(const F*) {
    if constexpr (!is_quadrature<F>) {
      if (F::name != name) return;
      with.template operator()<F>();
      found = true;
    }
  };
  [&]<class... F>(const std::tuple<F...>*) {
    (look(static_cast<const F*>(nullptr)), ...);
  }(static_cast<const ApproximationForms*>(nullptr));
  if (!found)
    throw Error(ExitCode::usage, "no form with a shader is called '" + std::string(name) + "'", "", "see fit/forms.h");
}

template <class F>
Shader trace_form(std::span<const double> constants) {
  Trace trace;
  std::vector<Expression> c, x;
  for (const double constant : constants) c.emplace_back(static_cast<double>(static_cast<float>(constant)));
  ShaderFunction function{.name = std::string(F::name), .arguments = {}};
  for (const std::string_view argument : F::arguments) {
    x.emplace_back(trace.node(Operation::input, ShaderType::scalar, {}, std::string(argument)));
    function.arguments.push_back({std::string(argument), ShaderType::scalar});
  }
  function.result = evaluate_on<F, Expression>(c, x).node;
  return trace.finish(std::move(function));
}

}  // namespace

std::string form_shader(std::string_view form, std::string_view language_name, std::span<const double> constants,
                        std::span<const std::string> provenance) {
  const ShaderLanguage& language = find_shader_language(language_name);
  std::string text;
  find_form_type(form, [&]<class F>() {
    const Shader shader = trace_form<F>(constants);
    text = fmt::format("// {}.\n// Source: {}.\n", F::title, F::source);
    for (const std::string& line : provenance) text += "// " + line + "\n";
    std::string arguments;
    for (const std::string_view argument : F::arguments) {
      arguments += (arguments.empty() ? "" : ", ") + argument_text(language, language.scalar, argument);
    }
    text += "\n" + shader_prologue(language) + definitions_text(language, shader) +
            function_head(language, language.scalar, "Lobefit_" + std::string(F::name), arguments) +
            body_text(language, shader.brdf) + "}\n";
  });
  return text;
}

OperationCount form_operations(std::string_view form, std::span<const double> constants) {
  OperationCount count;
  find_form_type(form, [&]<class F>() { count = count_operations(trace_form<F>(constants)); });
  return count;
}

float form_in_float(std::string_view form, std::span<const double> constants, std::span<const double> arguments) {
  float value = 0.0f;
  find_form_type(form, [&]<class F>() {
    std::vector<Single> c(constants.begin(), constants.end()), x(arguments.begin(), arguments.end());
    value = evaluate_on<F, Single>(c, x).value;
  });
  return value;
}

}  // namespace lobefit
