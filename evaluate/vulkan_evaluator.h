// Models as shaders on a Vulkan device.
#pragma once

#include "evaluate/float_device.h"
#include "evaluate/vulkan_device.h"

namespace lobefit {

/// The exported text of a model, as export prints it, in one language on one device.
class VulkanEvaluator : public FloatDevice {
 public:
  /// `device` must outlive it. Throws Error(usage) for an unknown language.
  VulkanEvaluator(const VulkanDevice& device, std::string_view language);
  double evaluate(const Model& model, const ParameterBlocks& parameters, const FloatPairs& pairs,
                  FloatRgb& values) const override;
  /// The same for a text that need not be the model's own.
  double evaluate_text(const Model& model, const std::string& text, const ParameterBlocks& parameters,
                       const FloatPairs& pairs, FloatRgb& values) const;

 private:
  const VulkanDevice& device_;
};

/// The model's exported text, with its defaults in Fitted().
std::string model_text(const Model& model, std::string_view language);

/// A compute shader around such a text: pairs of directions come in, tables and parameter sets are constants, BRDFs go
/// out. The text's tables give way to a buffer: software drivers take minutes to compile constant arrays.
struct EvaluationShader {
  std::string text;
  std::vector<float> constants;
};
EvaluationShader evaluation_shader(const Model& model, std::string_view language, const std::string& model_text,
                                   const ParameterBlocks& parameters);

}  // namespace lobefit
