#include "cli/output_folder.h"

#include <unistd.h>

#include "models/error.h"
#include "reference/output_file.h"

namespace lobefit {

namespace fs = std::filesystem;

OutputFolder::OutputFolder(fs::path destination, bool overwrite) : destination_(std::move(destination)) {
  if (destination_.filename().empty()) destination_ = destination_.parent_path();  // "out/" names out
  std::error_code code;
  const bool exists = fs::exists(destination_, code);
  if (exists && !fs::is_directory(destination_, code)) {
    throw Error(ExitCode::usage, "output is a file, not a folder", destination_.string(), "choose another name");
  }
  if (exists && !overwrite && !fs::is_empty(destination_, code)) {
    throw Error(ExitCode::usage, "output folder exists", destination_.string(),
                "choose another name, or add --force to replace its files");
  }
  const fs::path parent = destination_.has_parent_path() ? destination_.parent_path() : fs::path(".");
  staging_ = parent / ("." + destination_.filename().string() + ".partial-" + std::to_string(getpid()));
  fs::create_directories(staging_, code);
  if (code) {
    throw Error(ExitCode::failure, "can't write: " + code.message(), destination_.string(),
                "check the folder and its permissions");
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
}

void OutputFolder::write(const std::string& name, const std::string& text) const {
  OutputFile file(path(name), true);
  file.write(text);
  file.commit();
}

void OutputFolder::commit() {
  try {
    fs::create_directories(destination_);
    for (const auto& file : fs::directory_iterator(staging_))
      fs::rename(file.path(), destination_ / file.path().filename());
  } catch (const fs::filesystem_error& error) {
    throw Error(ExitCode::failure, "can't write: " + error.code().message(), destination_.string(), "check the folder");
  }
}

}  // namespace lobefit
