// Bytes of base64, by OpenSSL.
#pragma once

#include <openssl/evp.h>

#include <algorithm>
#include <string>

namespace lobefit {

inline std::string bytes_of_base64(const std::string& text) {
  std::string bytes(text.size(), '\0');
  const int size = EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()),
                                   reinterpret_cast<const unsigned char*>(text.data()), static_cast<int>(text.size()));
  // OpenSSL counts the zeros that padding stands for.
  bytes.resize(static_cast<std::size_t>(std::max<std::ptrdiff_t>(size - std::ranges::count(text, '='), 0)));
  return bytes;
}

}  // namespace lobefit
