// The vocabulary in which every model is written.
//
// A model is one function text, instantiated on four scalars:
//   double      the truth of the formula (this header)
//   Single      a float that never promotes, for vectorised batches (evaluate/single.h)
//   Dual<N>     value and N derivatives, for Ceres (fit/dual.h)
//   Expression  a tracing scalar that prints shaders (evaluate/expression.h)
//
// So a text uses what all four understand:
//   - arithmetic, comparisons, Vec3, and the functions below; literals are plain doubles;
//   - select(condition, a, b) instead of if, ?: or switch: no early return;
//   - pow and sqrt, which are guarded (see there);
//   - let("name", value) for an intermediate that a reader of the shader should see by name;
//   - call<Function>(arguments...) for a term that should become a function of the shader.
//
//   template <class G> LOBEFIT_TEXT static auto evaluate(const Parameters<T>& p, const Geometry<G>& g) {
//     const auto grazing = let("grazing", 1.0 - g.cos_theta_d);
//     return p.albedo / pi * call<SchlickWeight>(grazing);
//   }
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <numbers>
#include <type_traits>

// Texts must be inlined into the vectorised loops: a call costs a factor of ten. Sanitizer builds turn this off,
// because inlined instrumented texts take minutes to compile.
#if defined(LOBEFIT_PLAIN_INLINE)
#define LOBEFIT_TEXT inline
#else
#define LOBEFIT_TEXT [[gnu::always_inline]] inline
#endif

namespace lobefit {

inline constexpr double pi = std::numbers::pi;

/// Base below which pow() is flat. Its logarithm is finite in float, so pow(0, y) stays finite on every scalar and
/// its derivatives do too. At x = 0 the guarded pow returns smallest_base^y instead of 0.
inline constexpr double smallest_base = 1e-36;

class Expression;

/// True for the tracing scalar and its vectors, whose functions are overloads in evaluate/expression.h.
template <class T>
inline constexpr bool is_traced = false;

template <class T>
struct Vec3;

template <class T>
inline constexpr bool is_vector = false;
template <class T>
inline constexpr bool is_vector<Vec3<T>> = true;

template <class... T>
concept Numeric = (!is_traced<T> && ...);
template <class T>
concept NumericScalar = !is_traced<T> && !is_vector<T>;

// ---- double ---------------------------------------------------------------------------------------------------

LOBEFIT_TEXT constexpr double min(double a, double b) { return a < b ? a : b; }
LOBEFIT_TEXT constexpr double max(double a, double b) { return a > b ? a : b; }
LOBEFIT_TEXT constexpr double abs(double x) { return x < 0.0 ? -x : x; }
LOBEFIT_TEXT constexpr double select(bool condition, double a, double b) { return condition ? a : b; }
/// √max(x, 0): rounding may push a vanishing radicand below zero.
LOBEFIT_TEXT double sqrt(double x) { return std::sqrt(max(x, 0.0)); }
LOBEFIT_TEXT double exp(double x) { return std::exp(x); }
LOBEFIT_TEXT double exp2(double x) { return std::exp2(x); }
/// log and log2 of max(x, smallest_base).
LOBEFIT_TEXT double log(double x) { return std::log(max(x, smallest_base)); }
LOBEFIT_TEXT double log2(double x) { return std::log2(max(x, smallest_base)); }
/// max(x, smallest_base)^y, for x ≥ 0. The base is guarded, not the result: see smallest_base.
LOBEFIT_TEXT double pow(double x, double y) { return std::pow(max(x, smallest_base), y); }
/// arccos of x clamped to [-1, 1].
LOBEFIT_TEXT double acos(double x) { return std::acos(min(max(x, -1.0), 1.0)); }

// ---- any numeric scalar ---------------------------------------------------------------------------------------

template <NumericScalar T>
LOBEFIT_TEXT constexpr auto square(const T& x) {
  return x * x;
}
/// x⁵; a function of its own in the shader.
struct Pow5 {
  static constexpr const char* name = "pow5";
  static constexpr std::array arguments{"x"};

  template <class T>
  LOBEFIT_TEXT static constexpr auto evaluate(const T& x) {
    const auto x2 = x * x;
    return x2 * x2 * x;
  }
};
template <NumericScalar T>
LOBEFIT_TEXT constexpr auto pow5(const T& x) {
  return Pow5::evaluate(x);
}
template <NumericScalar T>
LOBEFIT_TEXT constexpr auto saturate(const T& x) {
  return min(max(x, 0.0), 1.0);
}
template <class A, class B, class T>
requires Numeric<A, B, T> LOBEFIT_TEXT constexpr auto lerp(const A& a, const B& b, const T& t) {
  return a + (b - a) * t;
}

// ---- three-vectors: directions and linear RGB -------------------------------------------------------------------

template <class T>
struct Vec3 {
  T x{}, y{}, z{};
};

template <class T>
inline constexpr bool is_traced<Vec3<T>> = is_traced<T>;

using Rgb = Vec3<double>;
using Direction = Vec3<double>;

#define LOBEFIT_VEC3_OPERATOR(op)                                                                           \
  template <class A, class B>                                                                               \
  requires NumericScalar<A> && NumericScalar<B> LOBEFIT_TEXT constexpr auto operator op(const Vec3<A>& a,   \
                                                                                        const Vec3<B>& b) { \
    return Vec3<decltype(a.x op b.x)>{a.x op b.x, a.y op b.y, a.z op b.z};                                  \
  }                                                                                                         \
  template <class A, class B>                                                                               \
  requires NumericScalar<A> && NumericScalar<B> LOBEFIT_TEXT constexpr auto operator op(const Vec3<A>& a,   \
                                                                                        const B& b) {       \
    return Vec3<decltype(a.x op b)>{a.x op b, a.y op b, a.z op b};                                          \
  }                                                                                                         \
  template <class A, class B>                                                                               \
  requires NumericScalar<A> && NumericScalar<B> LOBEFIT_TEXT constexpr auto operator op(const A& a,         \
                                                                                        const Vec3<B>& b) { \
    return Vec3<decltype(a op b.x)>{a op b.x, a op b.y, a op b.z};                                          \
  }
LOBEFIT_VEC3_OPERATOR(+)
LOBEFIT_VEC3_OPERATOR(-)
LOBEFIT_VEC3_OPERATOR(*)
LOBEFIT_VEC3_OPERATOR(/)
#undef LOBEFIT_VEC3_OPERATOR

template <NumericScalar T>
LOBEFIT_TEXT constexpr Vec3<T> operator-(const Vec3<T>& v) {
  return {-v.x, -v.y, -v.z};
}
template <class A, class B>
requires Numeric<A, B> LOBEFIT_TEXT constexpr auto dot(const Vec3<A>& a, const Vec3<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <NumericScalar T>
LOBEFIT_TEXT constexpr Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <NumericScalar T>
LOBEFIT_TEXT Vec3<T> normalize(const Vec3<T>& v) {
  return v / sqrt(max(dot(v, v), smallest_base));
}
template <class C, NumericScalar T>
LOBEFIT_TEXT constexpr Vec3<T> select(const C& condition, const Vec3<T>& a, const Vec3<T>& b) {
  return {select(condition, a.x, b.x), select(condition, a.y, b.y), select(condition, a.z, b.z)};
}
template <NumericScalar T>
LOBEFIT_TEXT constexpr Vec3<T> max(const Vec3<T>& a, double b) {
  return {max(a.x, b), max(a.y, b), max(a.z, b)};
}

// ---- names and functions that the shader keeps ------------------------------------------------------------------

/// Names an intermediate in the printed shader; the identity on numeric scalars.
template <class T>
requires Numeric<T> LOBEFIT_TEXT constexpr const T& let(const char*, const T& value) { return value; }

/// How Expression turns a call into a function of the shader; defined in evaluate/expression.h.
template <class F>
struct TracedCall;

/// Calls F::evaluate(arguments...). Inline in C++; a function named F::name in the printed shader.
template <class F, class... A>
LOBEFIT_TEXT constexpr auto call(const A&... arguments) {
  if constexpr ((is_traced<A> || ...)) {
    return TracedCall<F>::trace(arguments...);
  } else {
    return F::evaluate(arguments...);
  }
}

}  // namespace lobefit
