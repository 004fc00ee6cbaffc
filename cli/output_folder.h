// Folders of results that appear when they are complete.
#pragma once

#include <filesystem>
#include <string>

namespace lobefit {

/// Files are written into a folder beside the destination and moved there by commit(); removed if it is not reached.
class OutputFolder {
 public:
  /// Throws Error(usage) if the destination exists and `overwrite` is false.
  OutputFolder(std::filesystem::path destination, bool overwrite);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where to write a file of this name before commit().
  std::filesystem::path path(const std::string& name) const { return staging_ / name; }
  /// Writes a text file there.
  void write(const std::string& name, const std::string& text) const;
  const std::filesystem::path& destination() const { return destination_; }
  /// Moves the files in; others that the destination holds stay.
  void commit();

 private:
  std::filesystem::path destination_, staging_;
};

}  // namespace lobefit
