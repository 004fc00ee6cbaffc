// Files that appear whole or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace lobefit {

/// A file written beside its final place and renamed there by commit(); removed if commit() is not reached.
class OutputFile {
 public:
  /// Throws Error(usage) if `path` exists and `overwrite` is false, Error(failure) if its folder can't be written.
  OutputFile(std::filesystem::path path, bool overwrite);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Where to write. The extension is that of the final path.
  const std::filesystem::path& temporary() const { return temporary_; }
  void write(std::string_view content);
  void commit();

 private:
  std::filesystem::path path_, temporary_;
  bool committed_ = false;
};

/// The whole of a text file; throws Error(invalid_input).
std::string read_file(const std::filesystem::path& path);

/// SHA-256 of a file's bytes in hexadecimal; throws Error(invalid_input).
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace lobefit
