#include "reference/part_file.h"

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <optional>
#include <span>

#include "models/error.h"
#include "reference/json_reader.h"

namespace lobefit {

namespace {

namespace fs = std::filesystem;

// Header: magic, length of the text, text, checksum. Block: line, length of the content, content, checksum. The content
// of a line is its part of every plane of the table, then of the mask. Checksums are SHA-256 of all before them.
static_assert(std::endian::native == std::endian::little, "numbers are kept as they lie in memory");
constexpr std::string_view magic = "lobefit part 1\r\n";  // as PNG does: shows what mangles line ends
constexpr std::size_t digest_size = 32, word_size = sizeof(std::uint64_t);
constexpr std::uint64_t longest_text = 1u << 30;

using Digest = std::array<unsigned char, digest_size>;

Digest digest_of(std::span<const char> bytes) {
  Digest digest;
  unsigned int size = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1 || size != digest_size) {
    throw Error(ExitCode::failure, "OpenSSL could not compute SHA-256", "", "check the OpenSSL installation");
  }
  return digest;
}

void add(std::string& bytes, const void* data, std::size_t size) { bytes.append(static_cast<const char*>(data), size); }

void add_word(std::string& bytes, std::uint64_t word) { add(bytes, &word, sizeof word); }

void add_digest(std::string& bytes, std::size_t first) {
  const Digest digest = digest_of(std::span(bytes).subspan(first));
  add(bytes, digest.data(), digest.size());
}

std::uint64_t word_at(std::span<const char> bytes, std::size_t place) {
  std::uint64_t word = 0;
  std::memcpy(&word, bytes.data() + place, sizeof word);
  return word;
}

/// Whether the bytes end with the checksum of what is before it.
bool intact(std::span<const char> bytes) {
  const Digest digest = digest_of(bytes.first(bytes.size() - digest_size));
  return std::memcmp(digest.data(), bytes.data() + bytes.size() - digest_size, digest_size) == 0;
}

/// Appends `size` bytes of the file to `bytes`; false where it ends before.
bool read_more(int descriptor, std::string& bytes, std::size_t size) {
  std::size_t at = bytes.size();
  bytes.resize(at + size);
  while (at < bytes.size()) {
    const ssize_t got = ::read(descriptor, bytes.data() + at, bytes.size() - at);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += static_cast<std::size_t>(got);
  }
  return true;
}

off_t size_of(int descriptor) {
  struct stat status = {};
  return fstat(descriptor, &status) == 0 ? status.st_size : 0;
}

/// What determines the bits of the lines, and which of them are wanted.
Json header_of(const Table& table) {
  Json header = table.fingerprint();
  header["shard"] = table.shards.text();
  return header;
}

enum class HeaderState { none, foreign, damaged, whole };

/// Reads the header, and leaves the file at its end.
HeaderState read_header(int descriptor, Json& header) {
  const auto size = static_cast<std::uint64_t>(size_of(descriptor));
  ::lseek(descriptor, 0, SEEK_SET);
  std::string bytes;
  const bool complete = read_more(descriptor, bytes, magic.size());
  // The program may have been ended while it wrote these very bytes.
  const std::size_t present = std::min<std::size_t>(size, magic.size());
  if (std::string_view(bytes.data(), present) != magic.substr(0, present)) return HeaderState::foreign;
  if (!complete || !read_more(descriptor, bytes, word_size)) return HeaderState::none;
  const std::uint64_t length = word_at(bytes, magic.size());
  if (length > longest_text) return HeaderState::damaged;
  if (bytes.size() + length + digest_size > size) return HeaderState::none;
  if (!read_more(descriptor, bytes, length + digest_size)) return HeaderState::none;
  if (!intact(bytes)) return HeaderState::damaged;
  header = Json::parse(bytes.substr(magic.size() + word_size, length), nullptr, false);
  return header.is_discarded() ? HeaderState::damaged : HeaderState::whole;
}

}  // namespace

PartFile::PartFile(fs::path output, const Options& options)
    : output_(std::move(output)), path_(output_.string() + ".part"), options_(options), start_(Clock::now()) {}

PartFile::~PartFile() { close(); }

void PartFile::close() {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

std::vector<bool> PartFile::begin(Table& table) {
  table_ = &table;
  planes_ = table.planes();
  start_ = Clock::now();
  const Json header = header_of(table);
  for (std::size_t y = 0; y < table.height(); ++y) wanted_ += table.shards.hold(y) ? 1 : 0;
  std::error_code ignored;
  if (options_.resume && !options_.overwrite && fs::exists(output_, ignored)) {
    take_finished_output(table);
    // The last run may have been ended between writing its output and removing this.
    if (open_and_lock(false)) {
      Json found;
      if (read_header(descriptor_, found) != HeaderState::whole || found != header) close();
    }
    return std::vector<bool>(table.height(), true);
  }
  std::vector<bool> done(table.height(), false);
  if (!open_and_lock(false)) return done;

  Json found;
  const HeaderState state = read_header(descriptor_, found);
  if (state == HeaderState::none || (options_.overwrite && !options_.resume)) {
    // Nothing in it, or nothing wanted: append() begins with the header again.
    if (size_of(descriptor_) > 0) truncate(0);
    return done;
  }
  if (state == HeaderState::foreign) {
    throw Error(ExitCode::usage, "not a file of kept lines", path_.string(), "remove it, or choose another output");
  }
  if (state == HeaderState::damaged) {
    throw Error(ExitCode::invalid_input, "the kept lines are damaged from their beginning on", path_.string(),
                "start anew with --force");
  }
  if (found != header) {
    throw Error(ExitCode::usage, "lines of another render are kept: " + differences(found, header), path_.string(),
                options_.resume ? "give that render's options again, or choose another output"
                                : "choose another output, or start anew with --force");
  }
  if (!options_.resume) {
    throw Error(ExitCode::usage, "finished lines of this render are kept", path_.string(),
                "go on with --resume, or start anew with --force");
  }
  read_lines(done);
  return done;
}

void PartFile::take_finished_output(Table& table) {
  const Table finished = Table::read(output_);
  const Json there = header_of(finished), here = header_of(table);
  if (there != here) {
    throw Error(ExitCode::usage, "the output exists and is another render: " + differences(there, here),
                output_.string(), "choose another output, or add --force to replace it");
  }
  // Provenance is the same; the command as it was given stays the finished table's.
  table = finished;
  output_is_finished_ = true;
  resumed_ = kept_ = wanted_;
}

bool PartFile::open_and_lock(bool create) {
  descriptor_ = ::open(path_.c_str(), O_RDWR | O_APPEND | O_CLOEXEC | (create ? O_CREAT : 0), 0666);
  if (descriptor_ < 0) {
    if (!create && errno == ENOENT) return false;
    throw Error(ExitCode::failure, std::string("can't open: ") + std::strerror(errno), path_.string(),
                "check the folder and its permissions");
  }
  // The lock ends with the process, however it ends. File systems without locks do without.
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    close();
    throw Error(ExitCode::usage, "another lobefit is rendering into this output", path_.string(),
                "wait for it, or choose another output");
  }
  struct stat status = {};
  if (fstat(descriptor_, &status) == 0 && status.st_nlink == 0) {
    // Its owner finished and removed it between our opening and locking.
    close();
    return open_and_lock(create);
  }
  return true;
}

void PartFile::read_lines(std::vector<bool>& done) {
  Table& table = *table_;
  const std::size_t width = table.width(), content = planes_.size() * width * sizeof(float) + width;
  std::string bytes;
  off_t end = ::lseek(descriptor_, 0, SEEK_CUR);
  while (true) {
    bytes.clear();
    if (!read_more(descriptor_, bytes, 2 * word_size + content + digest_size)) break;
    const std::uint64_t line = word_at(bytes, 0);
    if (word_at(bytes, word_size) != content || !intact(bytes) || line >= table.height() || !table.shards.hold(line)) {
      break;
    }
    const char* next = bytes.data() + 2 * word_size;
    for (const Plane& plane : planes_) {
      std::memcpy(plane.data + line * width, next, width * sizeof(float));
      next += width * sizeof(float);
    }
    std::memcpy(table.valid.data() + line * width, next, width);
    if (!done[line]) ++kept_;
    done[line] = true;
    end += static_cast<off_t>(bytes.size());
  }
  resumed_ = kept_;
  // From the first block that is torn on nothing can be trusted; those lines are rendered again.
  dropped_ = end < size_of(descriptor_);
  if (dropped_) truncate(end);
}

void PartFile::truncate(off_t size) {
  if (::ftruncate(descriptor_, size) != 0) {
    throw Error(ExitCode::failure, std::string("can't write: ") + std::strerror(errno), path_.string(),
                "check its permissions");
  }
}

void PartFile::keep(std::size_t line) {
  const std::lock_guard lock(mutex_);
  pending_.push_back(line);
  if (Clock::now() - start_ >= options_.patience) append_pending();
}

void PartFile::flush() {
  const std::lock_guard lock(mutex_);
  append_pending();
}

void PartFile::append_pending() {
  if (pending_.empty()) return;
  if (descriptor_ < 0) open_and_lock(true);
  std::string bytes;
  if (size_of(descriptor_) == 0) {
    const std::string text = header_of(*table_).dump();
    add(bytes, magic.data(), magic.size());
    add_word(bytes, text.size());
    add(bytes, text.data(), text.size());
    add_digest(bytes, 0);
    append(bytes);
  }
  const std::size_t width = table_->width();
  while (!pending_.empty()) {
    const std::size_t line = pending_.back();
    bytes.clear();
    add_word(bytes, line);
    add_word(bytes, planes_.size() * width * sizeof(float) + width);
    for (const Plane& plane : planes_) add(bytes, plane.data + line * width, width * sizeof(float));
    add(bytes, table_->valid.data() + line * width, width);
    add_digest(bytes, 0);
    append(bytes);
    pending_.pop_back();
    ++kept_;
  }
}

void PartFile::append(const std::string& bytes) {
  const off_t before = size_of(descriptor_);
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t written = ::write(descriptor_, bytes.data() + at, bytes.size() - at);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const std::string reason = written < 0 ? std::strerror(errno) : "nothing was written";
      // The block may be whole once there is space again.
      if (::ftruncate(descriptor_, before) != 0) {
        // Then it stays torn, and the next run drops it.
      }
      throw Error(ExitCode::failure, "can't keep finished lines: " + reason, path_.string(),
                  "free some space, then go on with --resume");
    }
    at += static_cast<std::size_t>(written);
  }
}

void PartFile::remove() {
  std::error_code ignored;
  if (descriptor_ >= 0) fs::remove(path_, ignored);
}

}  // namespace lobefit
