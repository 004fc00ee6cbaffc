// Joining the shards of a render.
#pragma once

#include <filesystem>
#include <span>

#include "reference/table.h"

namespace lobefit {

/// The table that one render would have made whose shards are in `files`, bit by bit; the order of files does not
/// matter. Throws Error(invalid_input) where they are no shards of one render, overlap, or leave shards out; with
/// `partial` the lines of missing shards are masked, and the result can be merged further.
Table merge_shards(std::span<const std::filesystem::path> files, bool partial);

}  // namespace lobefit
