// LibmFloat: Single's arithmetic with libm's functions. Compiled scalar, it is what a plain float port of a model
// costs.
#pragma once

#include <cmath>
#include <cstdint>

#include "models/scalar.h"

namespace lobefit {

class LibmFloat {
 public:
  float value = 0.0f;

  LibmFloat() = default;
  LOBEFIT_TEXT constexpr LibmFloat(double x) : value(static_cast<float>(x)) {}
  LOBEFIT_TEXT constexpr explicit LibmFloat(float x) : value(x) {}

  LOBEFIT_TEXT friend LibmFloat operator+(LibmFloat a, LibmFloat b) { return LibmFloat(a.value + b.value); }
  LOBEFIT_TEXT friend LibmFloat operator-(LibmFloat a, LibmFloat b) { return LibmFloat(a.value - b.value); }
  LOBEFIT_TEXT friend LibmFloat operator*(LibmFloat a, LibmFloat b) { return LibmFloat(a.value * b.value); }
  LOBEFIT_TEXT friend LibmFloat operator/(LibmFloat a, LibmFloat b) { return LibmFloat(a.value / b.value); }
  LOBEFIT_TEXT friend LibmFloat operator-(LibmFloat a) { return LibmFloat(-a.value); }
  LOBEFIT_TEXT friend bool operator<(LibmFloat a, LibmFloat b) { return a.value < b.value; }
  LOBEFIT_TEXT friend bool operator>(LibmFloat a, LibmFloat b) { return a.value > b.value; }
  LOBEFIT_TEXT friend bool operator<=(LibmFloat a, LibmFloat b) { return a.value <= b.value; }
  LOBEFIT_TEXT friend bool operator>=(LibmFloat a, LibmFloat b) { return a.value >= b.value; }

  LOBEFIT_TEXT friend LibmFloat min(LibmFloat a, LibmFloat b) { return a < b ? a : b; }
  LOBEFIT_TEXT friend LibmFloat max(LibmFloat a, LibmFloat b) { return a > b ? a : b; }
  LOBEFIT_TEXT friend LibmFloat abs(LibmFloat x) { return LibmFloat(std::abs(x.value)); }
  LOBEFIT_TEXT friend LibmFloat select(bool condition, LibmFloat a, LibmFloat b) { return condition ? a : b; }

  LOBEFIT_TEXT friend LibmFloat floor(LibmFloat x) { return LibmFloat(std::floor(x.value)); }
  LOBEFIT_TEXT friend std::int32_t to_index(LibmFloat x) { return static_cast<std::int32_t>(x.value); }
  LOBEFIT_TEXT friend LibmFloat sqrt(LibmFloat x) { return LibmFloat(std::sqrt(max(x, 0.0).value)); }
  LOBEFIT_TEXT friend LibmFloat exp(LibmFloat x) { return LibmFloat(std::exp(x.value)); }
  LOBEFIT_TEXT friend LibmFloat exp2(LibmFloat x) { return LibmFloat(std::exp2(x.value)); }
  LOBEFIT_TEXT friend LibmFloat log(LibmFloat x) { return LibmFloat(std::log(max(x, smallest_base).value)); }
  LOBEFIT_TEXT friend LibmFloat log2(LibmFloat x) { return LibmFloat(std::log2(max(x, smallest_base).value)); }
  LOBEFIT_TEXT friend LibmFloat pow(LibmFloat x, LibmFloat y) {
    return LibmFloat(std::pow(max(x, smallest_base).value, y.value));
  }
  LOBEFIT_TEXT friend LibmFloat acos(LibmFloat x) { return LibmFloat(std::acos(min(max(x, -1.0), 1.0).value)); }
};

}  // namespace lobefit
