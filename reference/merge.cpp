#include "reference/merge.h"

#include <algorithm>

#include "models/error.h"
#include "models/parameter.h"

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

Table join_polar_angles(std::span<const Table> tables, std::span<const std::filesystem::path> names) {
  if (tables.empty()) throw Error(ExitCode::usage, "no tables", "table merge", "name the files to join");
  const Table& first = tables.front();
  const bool views = tables.size() < 2 || first.grid.theta_i.values == tables[1].grid.theta_i.values;
  const auto axis = [&](const Table& table) -> const Axis& { return views ? table.grid.theta_o : table.grid.theta_i; };
  const auto rest = [&](const Table& table) {
    Json fingerprint = table.fingerprint();
    fingerprint["axes"].erase(axis(table).name);
    return fingerprint;
  };
  Axis joined = axis(first);
  joined.values.clear();
  for (std::size_t t = 0; t < tables.size(); ++t) {
    const Table& table = tables[t];
    if (table.coordinates != Coordinates::spherical || table.shards.count > 1) {
      throw refused("not a whole table over polar angles and azimuths", names[t],
                    "shards and measured grids are no slices at single angles");
    }
    const Json there = rest(first), here = rest(table);
    if (there != here || axis(table).midpoints != joined.midpoints) {
      throw refused("differs from " + names[0].string() + " in more than one polar angle: " + differences(there, here),
                    names[t], "give tables over the same other axes");
    }
    joined.values.insert(joined.values.end(), axis(table).values.begin(), axis(table).values.end());
  }
  std::sort(joined.values.begin(), joined.values.end());
  const auto twice = std::adjacent_find(joined.values.begin(), joined.values.end());
  if (twice != joined.values.end()) {
    throw refused(joined.name + " = " + number_text(*twice) + " comes twice", "table merge", "give every angle once");
  }
  Table result = first;
  (views ? result.grid.theta_o : result.grid.theta_i) = joined;
  result.allocate();
  result.replicates.resize(first.replicates.empty() ? 0 : result.values.size() * replicate_count);
  result.order_replicates.resize(first.order_replicates.empty() ? 0 : result.order_values.size() * replicate_count);
  result.sample_counts.resize(first.sample_counts.empty() ? 0 : result.entries());
  const std::vector<Plane> targets = result.planes();
  for (std::size_t t = 0; t < tables.size(); ++t) {
    Table table = tables[t];
    const std::vector<Plane> sources = table.planes();
    if (sources.size() != targets.size()) {
      throw refused("keeps other planes than " + names[0].string(), names[t], "render all with the same options");
    }
    std::vector<std::size_t> places;
    for (const double value : axis(table).values) {
      places.push_back(static_cast<std::size_t>(std::lower_bound(joined.values.begin(), joined.values.end(), value) -
                                                joined.values.begin()));
    }
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      const std::size_t o = table.theta_o_index(entry), i = table.theta_i_index(entry);
      const std::size_t line = table.parameter_row(entry) * result.lines_per_parameter() + (views ? places[o] : o);
      const std::size_t target =
          line * result.width() + (views ? i : places[i]) * table.grid.phi.size() + table.phi_index(entry);
      for (std::size_t p = 0; p < sources.size(); ++p) targets[p].data[target] = sources[p].data[entry];
      result.valid[target] = table.valid[entry];
    }
  }
  return result;
}

}  // namespace lobefit
