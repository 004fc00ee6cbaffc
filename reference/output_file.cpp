#include "reference/output_file.h"

#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "models/error.h"

namespace lobefit {

namespace fs = std::filesystem;

OutputFile::OutputFile(fs::path path, bool overwrite) : path_(std::move(path)) {
  std::error_code ignored;
  if (fs::is_directory(path_, ignored)) {
    throw Error(ExitCode::usage, "output is a folder", path_.string(), "name a file in it");
  }
  if (!overwrite && fs::exists(path_, ignored)) {
    throw Error(ExitCode::usage, "output exists", path_.string(), "choose another name, or add --force to replace it");
  }
  temporary_ = path_.parent_path() /
               ("." + path_.stem().string() + ".partial-" + std::to_string(getpid()) + path_.extension().string());
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
