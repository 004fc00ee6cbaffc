#include "bench/libm_model.h"

namespace lobefit {

#define LOBEFIT_MODEL(Type, header) \
  void evaluate_libm_##Type(std::span<const float>, const FloatPairs&, std::size_t, std::size_t, FloatRgb&);
#include "models/list.def"
#undef LOBEFIT_MODEL

std::span<const Batch> libm_batches() {
  static const std::vector<Batch> all{
#define LOBEFIT_MODEL(Type, header) &evaluate_libm_##Type,
#include "models/list.def"
#undef LOBEFIT_MODEL
  };
  return all;
}

}  // namespace lobefit
