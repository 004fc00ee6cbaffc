// What keeps the finished lines of a long render, so that nothing stops it for good.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "reference/table.h"

namespace lobefit {

/// The finished lines of a table that is still being rendered, in OUTPUT.part beside the output: a header that names
/// the render, then a block per line, each with its checksum. Blocks are only ever appended, so whatever ends the
/// program leaves at worst one torn block at the end, which the next run drops.
class PartFile {
 public:
  struct Options {
    bool resume = false;     // go on from what is kept; a finished output counts too
    bool overwrite = false;  // the output may be replaced; without `resume` also what is kept
    /// Short renders never touch the disk: lines are kept once this is over.
    std::chrono::milliseconds patience = std::chrono::seconds(1);
  };

  PartFile(std::filesystem::path output, const Options& options);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  /// Before the work: puts the lines that earlier runs finished into `table` and tells which they are. `table` has to
  /// stay where it is until the work ends. Throws Error(usage) where something is kept that is of another render, or
  /// that the user did not ask to go on with.
  std::vector<bool> begin(Table& table);
  /// A line is finished. From any thread.
  void keep(std::size_t line);
  /// Writes what is finished, patience or not.
  void flush();
  /// The output is written: nothing needs to be kept any more.
  void remove();

  const std::filesystem::path& path() const { return path_; }
  /// Lines on disk, those of earlier runs included.
  std::size_t kept() const { return kept_; }
  /// Lines that earlier runs finished.
  std::size_t resumed() const { return resumed_; }
  /// Lines of the render, or of its shards.
  std::size_t wanted() const { return wanted_; }
  /// The end of what was kept was torn, and its lines are rendered again.
  bool dropped() const { return dropped_; }
  /// The output held the whole render already.
  bool output_is_finished() const { return output_is_finished_; }

 private:
  using Clock = std::chrono::steady_clock;

  void take_finished_output(Table& table);
  bool open_and_lock(bool create);
  void close();
  void read_lines(std::vector<bool>& done);
  void append_pending();
  void append(const std::string& bytes);
  void truncate(off_t size);

  const std::filesystem::path output_, path_;
  const Options options_;
  Clock::time_point start_;
  Table* table_ = nullptr;
  std::vector<Plane> planes_;
  std::mutex mutex_;
  std::vector<std::size_t> pending_;  // finished, but not on disk
  int descriptor_ = -1;
  std::size_t kept_ = 0, resumed_ = 0, wanted_ = 0;
  bool dropped_ = false, output_is_finished_ = false;
};

}  // namespace lobefit
