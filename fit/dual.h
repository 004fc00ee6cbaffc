// Dual<N>: a value and N derivatives as a plain array, for forward differentiation.
//
// Like ceres::Jet, but laid out so that its loops vectorise in run-time-dispatched code. At the kinks (min, max, abs,
// select) the derivative is that of the branch taken; sqrt at 0 and pow below smallest_base are flat, not infinite.
#pragma once

#include <array>
#include <cstdint>

#include "models/scalar.h"

namespace lobefit {

template <int N>
class Dual {
 public:
  double value = 0.0;
  std::array<double, N> derivative{};

  Dual() = default;
  LOBEFIT_TEXT constexpr Dual(double x) : value(x) {}

  /// The independent variable number `index`.
  static Dual variable(double x, int index) {
    Dual d(x);
    d.derivative[static_cast<std::size_t>(index)] = 1.0;
    return d;
  }

  /// The chain rule: `value`, with a's derivatives times `slope`.
  LOBEFIT_TEXT static Dual chain(double value, const Dual& a, double slope) {
    Dual r;
    r.value = value;
    for (std::size_t k = 0; k < N; ++k) r.derivative[k] = slope * a.derivative[k];
    return r;
  }
  LOBEFIT_TEXT static Dual chain(double value, const Dual& a, double slope_a, const Dual& b, double slope_b) {
    Dual r;
    r.value = value;
    for (std::size_t k = 0; k < N; ++k) r.derivative[k] = slope_a * a.derivative[k] + slope_b * b.derivative[k];
    return r;
  }

  LOBEFIT_TEXT friend Dual operator+(const Dual& a, const Dual& b) { return chain(a.value + b.value, a, 1.0, b, 1.0); }
  LOBEFIT_TEXT friend Dual operator-(const Dual& a, const Dual& b) { return chain(a.value - b.value, a, 1.0, b, -1.0); }
  LOBEFIT_TEXT friend Dual operator*(const Dual& a, const Dual& b) {
    return chain(a.value * b.value, a, b.value, b, a.value);
  }
  LOBEFIT_TEXT friend Dual operator/(const Dual& a, const Dual& b) {
    const double inverse = 1.0 / b.value;
    const double quotient = a.value * inverse;
    return chain(quotient, a, inverse, b, -quotient * inverse);
  }
  LOBEFIT_TEXT friend Dual operator+(const Dual& a, double b) { return chain(a.value + b, a, 1.0); }
  LOBEFIT_TEXT friend Dual operator+(double a, const Dual& b) { return chain(a + b.value, b, 1.0); }
  LOBEFIT_TEXT friend Dual operator-(const Dual& a, double b) { return chain(a.value - b, a, 1.0); }
  LOBEFIT_TEXT friend Dual operator-(double a, const Dual& b) { return chain(a - b.value, b, -1.0); }
  LOBEFIT_TEXT friend Dual operator*(const Dual& a, double b) { return chain(a.value * b, a, b); }
  LOBEFIT_TEXT friend Dual operator*(double a, const Dual& b) { return chain(a * b.value, b, a); }
  LOBEFIT_TEXT friend Dual operator/(const Dual& a, double b) { return chain(a.value / b, a, 1.0 / b); }
  LOBEFIT_TEXT friend Dual operator/(double a, const Dual& b) {
    const double quotient = a / b.value;
    return chain(quotient, b, -quotient / b.value);
  }
  LOBEFIT_TEXT friend Dual operator-(const Dual& a) { return chain(-a.value, a, -1.0); }

  LOBEFIT_TEXT friend bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  LOBEFIT_TEXT friend bool operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
  LOBEFIT_TEXT friend bool operator<=(const Dual& a, const Dual& b) { return a.value <= b.value; }
  LOBEFIT_TEXT friend bool operator>=(const Dual& a, const Dual& b) { return a.value >= b.value; }

  LOBEFIT_TEXT friend Dual min(const Dual& a, const Dual& b) { return a.value < b.value ? a : b; }
  LOBEFIT_TEXT friend Dual max(const Dual& a, const Dual& b) { return a.value > b.value ? a : b; }
  LOBEFIT_TEXT friend Dual abs(const Dual& a) { return a.value < 0.0 ? -a : a; }
  LOBEFIT_TEXT friend Dual select(bool condition, const Dual& a, const Dual& b) { return condition ? a : b; }

  LOBEFIT_TEXT friend Dual floor(const Dual& a) { return std::floor(a.value); }
  LOBEFIT_TEXT friend std::int32_t to_index(const Dual& a) { return static_cast<std::int32_t>(a.value); }

  LOBEFIT_TEXT friend Dual sqrt(const Dual& a) {
    const double root = lobefit::sqrt(a.value);
    return chain(root, a, root > 0.0 ? 0.5 / root : 0.0);
  }
  LOBEFIT_TEXT friend Dual exp(const Dual& a) {
    const double e = std::exp(a.value);
    return chain(e, a, e);
  }
  LOBEFIT_TEXT friend Dual exp2(const Dual& a) {
    const double e = std::exp2(a.value);
    return chain(e, a, e * std::numbers::ln2);
  }
  LOBEFIT_TEXT friend Dual log(const Dual& a) {
    return chain(lobefit::log(a.value), a, a.value > smallest_base ? 1.0 / a.value : 0.0);
  }
  LOBEFIT_TEXT friend Dual log2(const Dual& a) {
    return chain(lobefit::log2(a.value), a, a.value > smallest_base ? std::numbers::log2e / a.value : 0.0);
  }
  LOBEFIT_TEXT friend Dual pow(const Dual& x, const Dual& y) {
    const double power = lobefit::pow(x.value, y.value);
    const double slope_x = x.value > smallest_base ? y.value * power / x.value : 0.0;
    return chain(power, x, slope_x, y, power * lobefit::log(x.value));
  }
  LOBEFIT_TEXT friend Dual acos(const Dual& a) {
    const double sine = lobefit::sqrt(1.0 - a.value * a.value);
    return chain(lobefit::acos(a.value), a, sine > 0.0 ? -1.0 / sine : 0.0);
  }
};

}  // namespace lobefit
