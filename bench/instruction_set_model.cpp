// Compiled with -mSET and -DINSTRUCTION_SET=SET, without clones.
#include "bench/instruction_set_model.h"

#include "evaluate/make_float_model.h"
#include "models/callisto/callisto.h"

#define LOBEFIT_JOIN_(a, b) a##b
#define LOBEFIT_JOIN(a, b) LOBEFIT_JOIN_(a, b)

namespace lobefit {

void LOBEFIT_JOIN(evaluate_callisto_, INSTRUCTION_SET)(std::span<const float> flat, const FloatPairs& pairs,
                                                       std::size_t begin, std::size_t end, FloatRgb& values) {
  float_batch<Callisto>(flat, pairs, begin, end, values);
}

}  // namespace lobefit
