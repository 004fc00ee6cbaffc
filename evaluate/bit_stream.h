// A stream of bits in 32-bit words, least significant first.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "models/error.h"

namespace lobefit {

[[noreturn]] inline void malformed_stream(const std::string& what) {
  throw Error(ExitCode::invalid_input, what, "stored material", "give the words that pack_material() made");
}

class BitWriter {
 public:
  void write(std::uint32_t code, int bits) {
    for (int k = 0; k < bits; ++k, ++position_) {
      if (position_ % 32 == 0) words_.push_back(0);
      words_.back() |= ((code >> k) & 1u) << (position_ % 32);
    }
  }
  void pad_to_word() { position_ = 32 * words_.size(); }
  std::vector<std::uint32_t> words() && { return std::move(words_); }

 private:
  std::vector<std::uint32_t> words_;
  std::size_t position_ = 0;
};

class BitReader {
 public:
  explicit BitReader(std::span<const std::uint32_t> words) : words_(words) {}

  std::uint32_t read(int bits) {
    if (position_ + static_cast<std::size_t>(bits) > 32 * words_.size()) {
      malformed_stream("the stream of " + std::to_string(words_.size()) + " words ends within the material");
    }
    std::uint32_t code = 0;
    for (int k = 0; k < bits; ++k, ++position_) code |= ((words_[position_ / 32] >> (position_ % 32)) & 1u) << k;
    return code;
  }
  void skip_padding() {
    if (position_ % 32 != 0 && read(static_cast<int>(32 - position_ % 32)) != 0) malformed_stream("padding is not 0");
  }
  bool at_end() const { return position_ == 32 * words_.size(); }

 private:
  std::span<const std::uint32_t> words_;
  std::size_t position_ = 0;
};

}  // namespace lobefit
