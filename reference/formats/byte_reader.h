// Reading bytes and text that may be broken: every complaint names the file and the byte or line.
#pragma once

#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "models/error.h"

namespace lobefit {

static_assert(std::endian::native == std::endian::little, "the formats are little-endian and copied as they are");

/// A file's bytes with a place in them. Nothing is allocated by a count before the bytes behind it are known to exist.
class ByteReader {
 public:
  ByteReader(std::string_view bytes, std::string file) : bytes_(bytes), file_(std::move(file)) {}

  std::size_t offset() const { return offset_; }
  std::size_t size() const { return bytes_.size(); }
  void seek(std::size_t offset) { offset_ = offset; }

  Error error(const std::string& what, std::optional<std::size_t> at = {}) const {
    return {ExitCode::invalid_input, what, file_ + ", byte " + std::to_string(at.value_or(offset_)),
            "fetch the file again, or look at its source"};
  }

  std::string_view take(std::size_t count, const char* what) {
    if (offset_ > bytes_.size() || count > bytes_.size() - offset_) {
      throw error("truncated: " + std::string(what) + " needs " + std::to_string(count) + " bytes, the file has " +
                  std::to_string(bytes_.size()) + " in all");
    }
    const std::string_view result = bytes_.substr(offset_, count);
    offset_ += count;
    return result;
  }
  template <class T>
  T number(const char* what) {
    T value;
    std::memcpy(&value, take(sizeof(T), what).data(), sizeof(T));
    return value;
  }

 private:
  std::string_view bytes_;
  std::string file_;
  std::size_t offset_ = 0;
};

/// The lines of a text, with their numbers.
class LineReader {
 public:
  LineReader(std::string_view text, std::string file) : rest_(text), file_(std::move(file)) {}

  /// The next line without its end, or none.
  std::optional<std::string_view> next() {
    if (rest_.empty()) return {};
    const std::size_t end = rest_.find('\n');
    std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    ++number_;
    return line;
  }
  std::size_t number() const { return number_; }
  Error error(const std::string& what, const std::string& mend = "fetch the file again, or look at its source") const {
    return {ExitCode::invalid_input, what, file_ + ", line " + std::to_string(number_), mend};
  }

 private:
  std::string_view rest_;
  std::string file_;
  std::size_t number_ = 0;
};

/// Cuts the next word off a text; empty at its end. `separators` are what lies between words.
inline std::string_view next_word(std::string_view& text, std::string_view separators = " \t") {
  const std::size_t begin = text.find_first_not_of(separators);
  if (begin == std::string_view::npos) {
    text = {};
    return {};
  }
  text.remove_prefix(begin);
  const std::string_view word = text.substr(0, text.find_first_of(separators));
  text.remove_prefix(word.size());
  return word;
}

/// The whole of a word as a number, or none. A number too small for a double is 0.
inline std::optional<double> parse_double(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0.0;
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size() || word.empty()) return {};
  if (code == std::errc::result_out_of_range) {
    const std::size_t exponent = word.find_first_of("eE");
    const bool tiny = exponent != std::string_view::npos && word.substr(exponent + 1).starts_with('-');
    return tiny ? 0.0 : std::numeric_limits<double>::infinity();
  }
  if (code != std::errc()) return {};
  return value;
}

/// As it fits into a file of floats: what does not is infinite, not undefined.
inline float to_float(double value) {
  constexpr double largest = std::numeric_limits<float>::max();
  if (value > largest) return std::numeric_limits<float>::infinity();
  if (value < -largest) return -std::numeric_limits<float>::infinity();
  return static_cast<float>(value);
}

}  // namespace lobefit
