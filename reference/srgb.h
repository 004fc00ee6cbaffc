// sRGB's transfer function (IEC 61966-2-1), both of linear light and of code values in [0, 1].
#pragma once

#include <cmath>

namespace lobefit {

inline double srgb_encode(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
}
inline double srgb_decode(double code) {
  return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
}

}  // namespace lobefit
