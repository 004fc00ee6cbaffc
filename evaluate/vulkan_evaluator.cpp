#include "evaluate/vulkan_evaluator.h"

#include <array>

#include "evaluate/shader_printer.h"
#include "evaluate/spirv.h"

namespace lobefit {

namespace {

constexpr std::size_t inputs = 6, outputs = 3;

std::string triple(const std::string& type, const std::string& array, const std::array<std::string, 3>& at) {
  return type + "(" + array + "[" + at[0] + "], " + array + "[" + at[1] + "], " + array + "[" + at[2] + "])";
}

/// Where input or output k of the item lies.
std::string plane(int k) { return std::to_string(k) + "u * item_count + i"; }

}  // namespace

std::string model_text(const Model& model, std::string_view language) {
  std::vector<ShaderParameter> parameters;
  const ParameterValues defaults = model.defaults();
  for (const ParameterInfo& info : model.parameters) {
    const std::span<const double> value = defaults.components(info);
    parameters.push_back({info, {value.begin(), value.end()}, ""});
  }
  return print_shader(find_float_model(model.info->name).trace(), language, *model.info, parameters, {});
}

EvaluationShader evaluation_shader(const Model& model, std::string_view language, const std::string& model_text,
                                   const ParameterBlocks& parameters) {
  std::vector<VulkanArray> arrays;
  std::vector<float> constants;
  std::string definitions;
  for (const ShaderTable& table : find_float_model(model.info->name).trace().tables) {
    definitions += "#define " + table_guard(table.name) + "\n";
    arrays.push_back({table_array(table.name), table.entries.size()});
    constants.insert(constants.end(), table.entries.begin(), table.entries.end());
  }
  const std::size_t sets = parameters.sets.size(), slots = parameters.sets[0].size();
  if (slots > 0) arrays.push_back({"lobefit_parameters", sets * slots});
  for (const std::vector<float>& set : parameters.sets) constants.insert(constants.end(), set.begin(), set.end());
  if (arrays.empty()) arrays.push_back({"lobefit_unused", 1});

  const std::string vector(find_shader_language(language).vector), name = "Lobefit_" + std::string(model.info->name);
  std::string statements = "    uint set = (first_item + i) / " + std::to_string(parameters.block_size) + "u % " +
                           std::to_string(sets) + "u;\n    uint slot = set * " + std::to_string(slots) + "u;\n    " +
                           name + "_Parameters p;\n";
  for (const ParameterInfo& info : model.parameters) {
    const auto slot = [&](int component) { return "slot + " + std::to_string(info.offset + component) + "u"; };
    statements += "    p." + std::string(info.name) + " = " +
                  (info.components == 3 ? triple(vector, "lobefit_parameters", {slot(0), slot(1), slot(2)})
                                        : "lobefit_parameters[" + slot(0) + "]") +
                  ";\n";
  }
  if (model.parameters.empty()) statements += "    p.unused = 0.0;\n";
  statements += "    " + vector + " brdf = " + name + "(" +
                triple(vector, "lobefit_inputs", {plane(0), plane(1), plane(2)}) + ", " +
                triple(vector, "lobefit_inputs", {plane(3), plane(4), plane(5)}) + ", p);\n";
  int k = 0;
  for (const char* component : {"x", "y", "z"}) {
    statements += "    lobefit_outputs[" + plane(k++) + "] = brdf." + component + ";\n";
  }
  return {vulkan_shader(language, arrays, definitions + model_text, statements), std::move(constants)};
}

VulkanEvaluator::VulkanEvaluator(const VulkanDevice& device, std::string_view language)
    : FloatDevice(device.info().name, std::string(find_shader_language(language).name), device.info().software),
      device_(device) {}

double VulkanEvaluator::evaluate(const Model& model, const ParameterBlocks& parameters, const FloatPairs& pairs,
                                 FloatRgb& values) const {
  return evaluate_text(model, model_text(model, language()), parameters, pairs, values);
}

double VulkanEvaluator::evaluate_text(const Model& model, const std::string& text, const ParameterBlocks& parameters,
                                      const FloatPairs& pairs, FloatRgb& values) const {
  const EvaluationShader shader = evaluation_shader(model, language(), text, parameters);
  const std::array<std::span<const float>, inputs> in{pairs.wi_x, pairs.wi_y, pairs.wi_z,
                                                      pairs.wo_x, pairs.wo_y, pairs.wo_z};
  const std::array<std::span<float>, outputs> out{values.r, values.g, values.b};
  return device_.run({compile_shader(language(), shader.text), inputs, outputs}, shader.constants, in, out);
}

}  // namespace lobefit
