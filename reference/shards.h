// Parts of a render that different machines make.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lobefit {

/// Which lines of a table are meant: those of some of `count` shards. All of them by default.
struct Shards {
  std::uint32_t count = 1;
  std::vector<std::uint32_t> indices{1};  // from 1 to `count`, increasing

  /// "2/3" or "1,3/7"; throws Error(usage) that names `what`.
  static Shards parse(std::string_view text, const std::string& what);
  std::string text() const;

  bool all() const { return indices.size() == count; }
  /// The shard that line number `line` belongs to.
  std::uint32_t of(std::size_t line) const;
  bool hold(std::size_t line) const;
  /// Indices that are not held.
  std::vector<std::uint32_t> missing() const;

  bool operator==(const Shards&) const = default;
};

}  // namespace lobefit
