// Who evaluates models in float: the CPU's SIMD batches, or a shader on a Vulkan device (vulkan_evaluator.h).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "evaluate/float_model.h"

namespace lobefit {

/// Parameters of pairs: each block of `block_size` pairs takes the next of `sets`, around and around.
struct ParameterBlocks {
  std::vector<std::vector<float>> sets;
  std::size_t block_size;

  std::size_t set_of(std::size_t pair) const { return pair / block_size % sets.size(); }
};

class FloatDevice {
 public:
  FloatDevice(std::string name, std::string language, bool software)
      : name_(std::move(name)), language_(std::move(language)), software_(software) {}
  virtual ~FloatDevice() = default;

  const std::string& name() const { return name_; }
  /// Of the shader that runs there; "" where none does.
  const std::string& language() const { return language_; }
  /// Runs on the CPU.
  bool software() const { return software_; }

  /// Sets `values`, as long as `pairs`. Returns the seconds that a warm evaluation took.
  virtual double evaluate(const Model& model, const ParameterBlocks& parameters, const FloatPairs& pairs,
                          FloatRgb& values) const = 0;

 private:
  std::string name_, language_;
  bool software_;
};

/// The vectorised float batches on all threads.
class SimdDevice : public FloatDevice {
 public:
  SimdDevice() : FloatDevice("simd", "", true) {}
  double evaluate(const Model& model, const ParameterBlocks& parameters, const FloatPairs& pairs,
                  FloatRgb& values) const override;
};

}  // namespace lobefit
