// Tables that are rendered into a file, and taken up where an earlier run stopped.
#pragma once

#include "cli/arguments.h"
#include "reference/part_file.h"

namespace lobefit {

/// Runs `rendering` with a part file beside `path`, says what was taken up and what the table hides (masked entries),
/// and writes the table, whole or not at all. `resume` goes on with what is kept. On Ctrl-C throws Error(interrupted)
/// that tells what is kept and how to go on.
Table render_into(const std::filesystem::path& path, bool resume, const Shards& shards, const Context& context,
                  const std::function<Table(const RenderJob& job)>& rendering);

}  // namespace lobefit
