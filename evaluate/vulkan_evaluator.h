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

/// The model's exported function, with its defaults in Fitted().
std::string model_text(const Model& model, std::string_view language);

/// A compute shader around that text: pairs of directions come in, parameters are constants, BRDFs go out.
std::string evaluation_shader(const Model& model, std::string_view language, const std::string& text,
                              std::size_t parameter_sets, std::size_t block_size);

}  // namespace lobefit
