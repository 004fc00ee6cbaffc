#include "report/html_values.h"

#include <Imath/half.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cmath>

namespace lobefit {

namespace {

double scale_of(std::span<const float> values) {
  double largest = 0.0;
  for (const float v : values) {
    if (std::isfinite(v)) largest = std::max(largest, std::abs(static_cast<double>(v)));
  }
  return largest > 0.0 ? std::exp2(std::ceil(std::log2(largest)) - 15.0) : 1.0;
}

half packed(float value, double scale) { return {static_cast<float>(static_cast<double>(value) / scale)}; }

}  // namespace

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&': result += "&amp;"; break;
      case '<': result += "&lt;"; break;
      case '>': result += "&gt;"; break;
      case '"': result += "&quot;"; break;
      default: result += c;
    }
  }
  return result;
}

std::string base64(std::string_view bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');  // EVP_EncodeBlock ends with a zero
  const int size =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                      reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

PackedValues pack_values(std::span<const float> values) {
  const double scale = scale_of(values);
  std::string bytes;
  bytes.reserve(2 * values.size());
  for (const float v : values) {
    const unsigned short bits = packed(v, scale).bits();
    bytes += static_cast<char>(bits & 0xff);
    bytes += static_cast<char>(bits >> 8);
  }
  return {scale, base64(bytes)};
}

}  // namespace lobefit
