#include "reference/shards.h"

#include <algorithm>
#include <charconv>

#include "models/error.h"

namespace lobefit {

namespace {

constexpr std::uint32_t most_shards = 1'000'000;

bool parse_whole(std::string_view text, std::uint32_t& value) {
  const auto [rest, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc{} && rest == text.data() + text.size() && value >= 1 && value <= most_shards;
}

}  // namespace

Shards Shards::parse(std::string_view text, const std::string& what) {
  const auto refuse = [&] {
    return Error(ExitCode::usage, "'" + std::string(text) + "' is no shard", what,
                 "write I/N such as 2/3: the second of three, I from 1 to N");
  };
  Shards result;
  result.indices.clear();
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos || !parse_whole(text.substr(slash + 1), result.count)) throw refuse();
  for (std::size_t begin = 0; begin <= slash;) {
    const std::size_t end = std::min(text.find(',', begin), slash);
    std::uint32_t index = 0;
    if (!parse_whole(text.substr(begin, end - begin), index) || index > result.count) throw refuse();
    if (!result.indices.empty() && index <= result.indices.back()) throw refuse();
    result.indices.push_back(index);
    begin = end + 1;
  }
  return result;
}

std::string Shards::text() const {
  std::string result;
  for (const std::uint32_t index : indices) result += (result.empty() ? "" : ",") + std::to_string(index);
  return result + "/" + std::to_string(count);
}

// Dealt out in rounds that begin one shard further each: what is costly along an axis (grazing views, rough surfaces)
// would meet the same shard again and again where `count` divides the axis' length.
std::uint32_t Shards::of(std::size_t line) const {
  return static_cast<std::uint32_t>((line % count + line / count) % count) + 1;
}

bool Shards::hold(std::size_t line) const { return std::binary_search(indices.begin(), indices.end(), of(line)); }

std::vector<std::uint32_t> Shards::missing() const {
  std::vector<std::uint32_t> result;
  for (std::uint32_t index = 1; index <= count; ++index) {
    if (!std::binary_search(indices.begin(), indices.end(), index)) result.push_back(index);
  }
  return result;
}

}  // namespace lobefit
