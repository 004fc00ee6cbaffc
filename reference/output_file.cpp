#include "reference/output_file.h"

#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <sstream>

#include "models/error.h"

namespace lobefit {

namespace fs = std::filesystem;

namespace {

/// Whether a process is at work: neither gone nor a zombie that nobody waits for, as in containers without an init.
bool alive(int process) {
  if (kill(process, 0) != 0 && errno == ESRCH) return false;
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string status;
  std::getline(file, status);
  const std::size_t name_end = status.rfind(')');
  return name_end == std::string::npos || name_end + 2 >= status.size() || status[name_end + 2] != 'Z';
}

/// A program that was killed could not remove its temporary file; names hold the process.
void remove_abandoned(const fs::path& folder, const std::string& prefix, const std::string& extension) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.empty() ? "." : folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.size() <= prefix.size() + extension.size() || !name.starts_with(prefix) || !name.ends_with(extension)) {
      continue;
    }
    const std::string number = name.substr(prefix.size(), name.size() - prefix.size() - extension.size());
    if (number.size() > 9 || number.find_first_not_of("0123456789") != std::string::npos) continue;
    if (!alive(std::stoi(number))) fs::remove(entry.path(), ignored);
  }
}

}  // namespace

OutputFile::OutputFile(fs::path path, bool overwrite) : path_(std::move(path)) {
  std::error_code ignored;
  if (fs::is_directory(path_, ignored)) {
    throw Error(ExitCode::usage, "output is a folder", path_.string(), "name a file in it");
  }
  if (!overwrite && fs::exists(path_, ignored)) {
    throw Error(ExitCode::usage, "output exists", path_.string(), "choose another name, or add --force to replace it");
  }
  const std::string prefix = "." + path_.stem().string() + ".partial-", extension = path_.extension().string();
  remove_abandoned(path_.parent_path(), prefix, extension);
  temporary_ = path_.parent_path() / (prefix + std::to_string(getpid()) + extension);
  // Tried now, so that hours of work are not spent on a result that can't be saved.
  std::ofstream probe(temporary_, std::ios::binary);
  if (!probe) {
    const std::string reason = std::strerror(errno);
    throw Error(ExitCode::failure, "can't write: " + reason, path_.string(), "check the folder and its permissions");
  }
}

OutputFile::~OutputFile() {
  std::error_code ignored;
  if (!committed_) fs::remove(temporary_, ignored);
}

void OutputFile::write(std::string_view content) {
  std::ofstream file(temporary_, std::ios::binary);
  file << content;
  file.close();
  if (!file) throw Error(ExitCode::failure, "write failed", path_.string(), "check the free space on the disk");
}

void OutputFile::commit() {
  std::error_code code;
  fs::rename(temporary_, path_, code);
  if (code) throw Error(ExitCode::failure, "can't write: " + code.message(), path_.string(), "check the folder");
  committed_ = true;
}

std::string read_file(const fs::path& path) {
  std::error_code code;
  if (fs::is_directory(path, code)) {
    throw Error(ExitCode::invalid_input, "expected a file, found a folder", path.string(), "name a file in it");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    const std::string reason = std::strerror(errno);
    throw Error(ExitCode::invalid_input, "can't read: " + reason, path.string(), "check the path");
  }
  std::ostringstream content;
  content << file.rdbuf();
  return content.str();
}

std::string sha256_of_file(const fs::path& path) {
  const std::string content = read_file(path);
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned int size = 0;
  if (EVP_Digest(content.data(), content.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1) {
    throw Error(ExitCode::failure, "OpenSSL could not compute SHA-256", path.string(),
                "check the OpenSSL installation");
  }
  constexpr std::string_view digits = "0123456789abcdef";
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    text += digits[digest[i] >> 4];
    text += digits[digest[i] & 15];
  }
  return text;
}

}  // namespace lobefit
