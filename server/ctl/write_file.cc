#include "server/ctl/write_file.h"

#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::ctl {
namespace {

absl::Status CannotWrite(const std::string& path, const std::string& why) {
  return absl::PermissionDeniedError(absl::StrCat(path, " cannot be written: ", why));
}

// Writes to a file that users know as `path`.
absl::Status Write(const std::string& to, const std::string& path, const std::string& content) {
  errno = 0;
  std::ofstream file(to, std::ios::binary | std::ios::trunc);
  file << content;
  file.close();
  return file.good() ? absl::OkStatus() : CannotWrite(path, std::generic_category().message(errno));
}

}  // namespace

absl::Status WriteFile(const std::string& path, const std::string& content) {
  return Write(path, path, content);
}

absl::StatusOr<OutputFile> OutputFile::Open(const std::string& path) {
  std::error_code error;
  const bool exists = std::filesystem::exists(path, error);
  if (exists && std::filesystem::is_directory(path, error)) return CannotWrite(path, "is a folder");
  if (exists && access(path.c_str(), W_OK) != 0) {
    return CannotWrite(path, std::generic_category().message(errno));
  }
  if (exists && !std::filesystem::is_regular_file(path, error)) return OutputFile(path, "");
  // A link stays one: what it points to is replaced.
  const std::string real = exists ? std::filesystem::canonical(path, error).string() : path;
  const std::string part = absl::StrCat(real, ".", getpid(), ".part");
  if (auto made = Write(part, path, ""); !made.ok()) return made;
  return OutputFile(real, part);
}

OutputFile::~OutputFile() {
  std::error_code error;
  if (!part_.empty()) std::filesystem::remove(part_, error);
}

absl::Status OutputFile::Put(const std::string& content) {
  if (part_.empty()) return WriteFile(path_, content);
  if (auto written = Write(part_, path_, content); !written.ok()) return written;
  std::error_code error;
  std::filesystem::rename(part_, path_, error);
  if (error) return CannotWrite(path_, error.message());
  part_.clear();
  return absl::OkStatus();
}

}  // namespace calib::ctl
