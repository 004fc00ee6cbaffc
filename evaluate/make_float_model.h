// From a model's text to its vectorised float batch and its shader. Compile with -O3 -ffp-contract=off -fno-math-errno
// -fno-trapping-math, or the loops are neither fast nor the same everywhere.
#pragma once

#include <array>
#include <utility>

#include "evaluate/float_model.h"
#include "evaluate/shader.h"
#include "models/instruction_sets.h"

namespace lobefit {

// Each translation unit has its own: GCC's clones of a template need internal linkage.
namespace {

// Bare pointers and a parameter struct that is made outside the loop: what the vectoriser can see through.
template <class V>
LOBEFIT_CLONES [[gnu::noinline]] void evaluate_chunk(const typename V::template Parameters<Single>& p,
                                                     const float* __restrict wi_x, const float* __restrict wi_y,
                                                     const float* __restrict wi_z, const float* __restrict wo_x,
                                                     const float* __restrict wo_y, const float* __restrict wo_z,
                                                     std::size_t n, float* __restrict r, float* __restrict g,
                                                     float* __restrict b) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3<Single> wi{Single(wi_x[i]), Single(wi_y[i]), Single(wi_z[i])};
    const Vec3<Single> wo{Single(wo_x[i]), Single(wo_y[i]), Single(wo_z[i])};
    Vec3<Single> value = evaluate_brdf<V>(p, wi, wo);
    r[i] = value.x.value;
    g[i] = value.y.value;
    b[i] = value.z.value;
  }
}

/// The loop for these parameters: of a model with named choices (see choose()) each combination has its own.
template <class M>
auto chunk_for([[maybe_unused]] std::span<const float> flat) {
  if constexpr (requires { M::variant_count; }) {
    static constexpr auto chunks = []<int... variant>(std::integer_sequence<int, variant...>) {
      return std::array{&evaluate_chunk<typename M::template Variant<variant>>...};
    }
    (std::make_integer_sequence<int, M::variant_count>{});
    return chunks[static_cast<std::size_t>(M::variant(flat))];
  } else {
    return &evaluate_chunk<M>;
  }
}

/// As FloatModel::evaluate.
template <class M>
void float_batch(std::span<const float> flat, const FloatPairs& pairs, std::size_t begin, std::size_t end,
                 FloatRgb& values) {
  chunk_for<M>(flat)(unflatten<M, Single>(flat), &pairs.wi_x[begin], &pairs.wi_y[begin], &pairs.wi_z[begin],
                     &pairs.wo_x[begin], &pairs.wo_y[begin], &pairs.wo_z[begin], end - begin, &values.r[begin],
                     &values.g[begin], &values.b[begin]);
}

}  // namespace

/// `M` as a GPU runs it:
///
///   add_float_model(make_float_model<MyModel>());   // after add_model()
template <class M>
FloatModel make_float_model() {
  return {.name = M::info.name, .evaluate = &float_batch<M>, .trace = &trace_shader<M>};
}

}  // namespace lobefit
