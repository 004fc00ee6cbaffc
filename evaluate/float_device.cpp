#include "evaluate/float_device.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>

namespace lobefit {

double SimdDevice::evaluate(const Model& model, const ParameterBlocks& parameters, const FloatPairs& pairs,
                            FloatRgb& values) const {
  const FloatModel& float_model = find_float_model(model.info->name);
  const std::size_t size = parameters.block_size, blocks = (pairs.size() + size - 1) / size;
  const auto once = [&] {
    const auto start = std::chrono::steady_clock::now();
    tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
      const std::size_t first = block * size;
      float_model.evaluate(parameters.sets[parameters.set_of(first)], pairs, first,
                           std::min(pairs.size(), first + size), values);
    });
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  once();  // warms pages and caches
  return once();
}

}  // namespace lobefit
