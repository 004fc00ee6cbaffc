#include "reference/diffuse/single_kernel.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "models/float_functions.h"
#include "models/instruction_sets.h"

namespace lobefit {

namespace {

constexpr std::size_t sum_count = 64;  // partial sums, the same on every instruction set

/// What depends on the configuration alone. Facets are m = (x α_x, y α_y, z)/length, (x, y, z) on the unit sphere:
/// every component is linear in the disk point (p1, p2) and the height p3 above it.
struct Configuration {
  float s;             // how much of the disk's far half is visible
  float z2, z3;        // z = z2 p2 + z3 p3
  float x1, x2, x3;    // x likewise
  float c1, c2, c3;    // length × (m·wi) likewise
  float base, xx, zz;  // length² = base + xx x² + zz z²
};

/// 1/√x by two steps of Newton's iteration from a guess in the exponent, the first one tuned (Kadlec 2010): relative
/// error below 7e-7. Products and sums only, whose units are wider than those of roots and quotients.
LOBEFIT_TEXT float float_inverse_root(float x) {
  float y = std::bit_cast<float>(0x5f1ffff9 - (std::bit_cast<std::int32_t>(x) >> 1));
  y = y * (1.68191391f - 0.703952253f * (x * y * y));
  return y * (1.5f - 0.5f * x * y * y);
}

/// Polar coordinates: u, the square of the radius, becomes x, and v, in turns, y.
LOBEFIT_CLONES [[gnu::noinline]] void map_to_disk(std::size_t n, float* __restrict u, float* __restrict v,
                                                  float* __restrict edge) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    float cosine, sine;
    float_cosine_and_sine_of_turns(v[i], cosine, sine);
    const float radius = __builtin_sqrtf(u[i]);
    const float x = radius * cosine;
    const float squared = (1.0f - x) * (1.0f + x);
    u[i] = x, v[i] = radius * sine, edge[i] = __builtin_sqrtf(squared > 0.0f ? squared : 0.0f);
  }
}

template <bool isotropic>
LOBEFIT_TEXT void add_cosines(const Configuration& c, const float* __restrict p1, const float* __restrict q,
                              const float* __restrict edge, std::size_t n, float* __restrict sums) {
  for (std::size_t first = 0; first < n; first += sum_count) {
#pragma GCC ivdep
    for (std::size_t j = 0; j < sum_count; ++j) {
      const std::size_t i = first + j;
      const float p2 = (1.0f - c.s) * edge[i] + c.s * q[i];
      const float left = (edge[i] - p2) * (edge[i] + p2);
      const float p3 = __builtin_sqrtf(left > 0.0f ? left : 0.0f);
      const float z = c.z2 * p2 + c.z3 * p3;
      float length2 = c.base + c.zz * (z * z);
      if constexpr (!isotropic) {
        const float x = c.x1 * p1[i] + c.x2 * p2 + c.x3 * p3;
        length2 += c.xx * (x * x);
      }
      const float cosine = (c.c1 * p1[i] + c.c2 * p2 + c.c3 * p3) * float_inverse_root(length2);
      sums[j] += cosine > 0.0f ? cosine : 0.0f;
    }
  }
}

LOBEFIT_CLONES [[gnu::noinline]] void add_isotropic(const Configuration& c, const float* __restrict p1,
                                                    const float* __restrict q, const float* __restrict edge,
                                                    std::size_t n, float* __restrict sums) {
  add_cosines<true>(c, p1, q, edge, n, sums);
}

LOBEFIT_CLONES [[gnu::noinline]] void add_anisotropic(const Configuration& c, const float* __restrict p1,
                                                      const float* __restrict q, const float* __restrict edge,
                                                      std::size_t n, float* __restrict sums) {
  add_cosines<false>(c, p1, q, edge, n, sums);
}

}  // namespace

DiskPoints::DiskPoints(const SamplePoints& points, std::uint32_t count)
    : count_(count), x_(count), y_(count), edge_(count) {
  // The points' own arrays serve as room for their numbers.
  points.fill(0, std::span(x_), std::span(y_));
  map_to_disk(count, x_.data(), y_.data(), edge_.data());
}

double mean_visible_cosine(const DiskPoints& points, Alpha alpha, const Direction& wo, const Direction& wi) {
  const Direction e = normalize(Direction{alpha.x * wo.x, alpha.y * wo.y, wo.z});
  const double across = std::hypot(e.x, e.y);
  const Direction t1 = across > 0.0 ? Direction{-e.y / across, e.x / across, 0.0} : Direction{1.0, 0.0, 0.0};
  const Direction t2 = cross(e, t1);
  const Direction light{alpha.x * wi.x, alpha.y * wi.y, wi.z};
  const auto f = [](double x) { return static_cast<float>(x); };
  // x² + y² + z² = 1 removes y from the length.
  const double base = alpha.y * alpha.y;
  const Configuration c{f(0.5 * (1.0 + e.z)),
                        f(t2.z),
                        f(e.z),
                        f(t1.x),
                        f(t2.x),
                        f(e.x),
                        f(dot(t1, light)),
                        f(dot(t2, light)),
                        f(dot(e, light)),
                        f(base),
                        f(alpha.x * alpha.x - base),
                        f(1.0 - base)};
  std::array<float, sum_count> sums{};
  const std::size_t whole = points.count() / sum_count * sum_count;
  const auto add = [&](const float* p1, const float* q, const float* edge, std::size_t n) {
    (alpha.x == alpha.y ? add_isotropic : add_anisotropic)(c, p1, q, edge, n, sums.data());
  };
  add(points.x().data(), points.y().data(), points.edge().data(), whole);
  double sum = 0.0;
  if (whole < points.count()) {
    // The last block, filled up with points that are not summed.
    std::array<std::array<float, sum_count>, 3> last;
    const std::array columns{points.x(), points.y(), points.edge()};
    for (std::size_t k = 0; k < last.size(); ++k) {
      last[k].fill(columns[k][0]);
      std::copy(columns[k].begin() + static_cast<std::ptrdiff_t>(whole), columns[k].end(), last[k].begin());
    }
    std::array<float, sum_count> tail{};
    std::swap(tail, sums);
    add(last[0].data(), last[1].data(), last[2].data(), sum_count);
    std::swap(tail, sums);
    for (std::size_t j = 0; j < points.count() - whole; ++j) sum += static_cast<double>(tail[j]);
  }
  for (const float lane : sums) sum += static_cast<double>(lane);
  return sum / points.count();
}

}  // namespace lobefit
