#include "cli/table_file.h"

#include <fmt/format.h>

#include "cli/sampling.h"
#include "reference/output_file.h"

namespace lobefit {

namespace {

/// Ctrl-C: what is kept, and how to go on.
Error interrupted(const PartFile& part, std::size_t lines) {
  if (part.kept() == 0) {
    return {ExitCode::interrupted, "interrupted", "", "no line was finished yet, so nothing is kept"};
  }
  return {ExitCode::interrupted, fmt::format("interrupted: {} of {} lines are kept", part.kept(), lines),
          part.path().string(), "the same command with --resume goes on"};
}

}  // namespace

Table render_into(const std::filesystem::path& path, bool resume, const Shards& shards, const Context& context,
                  const std::function<Table(const RenderJob& job)>& rendering) {
  // A finished output may lie there when resuming; whether it is this render's is looked at before the work.
  OutputFile file(path, context.force || resume);
  PartFile part(path, {.resume = resume, .overwrite = context.force});
  Table table;
  try {
    table = rendering({.shards = shards, .part = &part});
  } catch (const Interrupted&) {
    throw interrupted(part, part.wanted());
  }
  if (part.resumed() > 0 && !part.output_is_finished()) {
    context.say(fmt::format("went on from {} of {} lines{}", part.resumed(), part.wanted(),
                            part.dropped() ? "; what was torn was rendered again" : ""));
  }
  if (part.output_is_finished()) {
    context.say(fmt::format("{} is finished already", path.string()));
  } else {
    table.command = context.command;
    table.write(file.temporary());
    file.commit();
  }
  part.remove();
  warn_about_failed(context, table);
  return table;
}

}  // namespace lobefit
