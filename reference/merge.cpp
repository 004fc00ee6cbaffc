#include "reference/merge.h"

#include <algorithm>

#include "models/error.h"

namespace lobefit {

namespace {

Error refused(const std::string& what, const std::filesystem::path& file, const std::string& mend) {
  return {ExitCode::invalid_input, what, file.string(), mend};
}

void copy_lines(Table& from, Table& to) {
  const std::vector<Plane> sources = from.planes(), targets = to.planes();
  const std::size_t width = from.width();
  for (std::size_t y = 0; y < from.height(); ++y) {
    if (!from.shards.hold(y)) continue;
    for (std::size_t p = 0; p < sources.size(); ++p) {
      std::copy_n(sources[p].data + y * width, width, targets[p].data + y * width);
    }
    const auto first = static_cast<std::ptrdiff_t>(y * width);
    std::copy_n(from.valid.begin() + first, width, to.valid.begin() + first);
  }
}

std::string list(const std::vector<std::uint32_t>& indices) {
  constexpr std::size_t most = 20;
  std::string text;
  for (std::size_t i = 0; i < std::min(indices.size(), most); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(indices[i]);
  }
  return indices.size() <= most ? text : text + ", … (" + std::to_string(indices.size()) + ")";
}

}  // namespace

Table merge_shards(std::span<const std::filesystem::path> files, bool partial) {
  if (files.empty()) throw Error(ExitCode::usage, "no shards", "table merge", "name the files that --shard made");
  Table merged;
  std::vector<const std::filesystem::path*> owners;  // [shard - 1]
  std::uint32_t lowest = 0;
  for (const std::filesystem::path& file : files) {
    Table table = Table::read(file);
    if (table.shards.count == 1) {
      throw refused("the table is whole, not a shard", file, "give tables that `lobefit render --shard I/N` wrote");
    }
    const bool first = &file == &files.front();
    if (first) {
      merged = table;
      owners.resize(table.shards.count, nullptr);
    } else {
      if (table.shards.count != merged.shards.count) {
        throw refused("one of " + std::to_string(table.shards.count) + " shards, the first file is one of " +
                          std::to_string(merged.shards.count),
                      file, "give the shards of one render");
      }
      const Json there = merged.fingerprint(), here = table.fingerprint();
      if (there != here || table.planes().size() != merged.planes().size()) {
        throw refused("not a shard of the same render as " + files.front().string() + ": " + differences(there, here),
                      file, "give the shards of one render");
      }
    }
    for (const std::uint32_t index : table.shards.indices) {
      if (owners[index - 1]) {
        throw refused("shard " + std::to_string(index) + " is in " + owners[index - 1]->string() + " too", file,
                      "give every shard once");
      }
      owners[index - 1] = &file;
    }
    if (first) {
      lowest = table.shards.indices.front();
      continue;
    }
    copy_lines(table, merged);
    // Commands may name a file by different paths: that of the lowest shard stays, in whatever order files come.
    if (table.shards.indices.front() < lowest) {
      lowest = table.shards.indices.front();
      merged.command = table.command;
    }
    std::vector<std::uint32_t>& indices = merged.shards.indices;
    indices.insert(indices.end(), table.shards.indices.begin(), table.shards.indices.end());
    std::sort(indices.begin(), indices.end());
  }
  const std::vector<std::uint32_t> missing = merged.shards.missing();
  if (missing.empty()) {
    merged.shards = {};
  } else if (!partial) {
    throw refused((missing.size() == 1 ? "missing shard " : "missing shards ") + list(missing) + " of " +
                      std::to_string(merged.shards.count),
                  "table merge", "render them, or mask their lines with --partial");
  }
  return merged;
}

}  // namespace lobefit
