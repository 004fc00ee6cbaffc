// Joining tables: the shards of a render, or slices at several polar angles.
#pragma once

#include <filesystem>
#include <span>

#include "reference/table.h"

namespace lobefit {

/// The table that one render would have made whose shards are in `files`, bit by bit; the order of files does not
/// matter. Throws Error(invalid_input) where they are no shards of one render, overlap, or leave shards out; with
/// `partial` the lines of missing shards are masked, and the result can be merged further.
Table merge_shards(std::span<const std::filesystem::path> files, bool partial);

/// One table of several that differ in one polar angle alone, of which each has its own: pictures of a lobe for several
/// views, say. The order of tables does not matter; all but the command is the first one's. `names` stand for them in
/// errors. Throws Error(invalid_input) where something else differs, or an angle comes twice.
Table join_polar_angles(std::span<const Table> tables, std::span<const std::filesystem::path> names);

}  // namespace lobefit
