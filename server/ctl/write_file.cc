#include "server/ctl/write_file.h"

#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

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
  if (exists && ::access(path.c_str(), W_OK) != 0) {
    return CannotWrite(path, std::generic_category().message(errno));
  }
  // Devices, pipes and links (/dev/stdout too) are written to themselves.
  if (exists && (!std::filesystem::is_regular_file(path, error) ||
                 std::filesystem::is_symlink(path, error))) {
    return OutputFile(path, "");
  }
  const std::string part = absl::StrCat(path, ".", getpid(), ".part");
  if (auto made = Write(part, path, ""); !made.ok()) {
    return exists ? absl::StatusOr<OutputFile>(OutputFile(path, ""))  // in a folder that is closed
                  : made;
  }
  if (exists) {
    std::filesystem::permissions(part, std::filesystem::status(path, error).permissions(), error);
  }
  return OutputFile(path, part);
}

OutputFile::~OutputFile() {
  std::error_code error;
  if (!part_.empty()) std::filesystem::remove(part_, error);
}

absl::Status OutputFile::Put(const std::string& content) {
  if (part_.empty()) return WriteFile(path_, content);
  RETURN_IF_ERROR(Write(part_, path_, content));
  std::error_code error;
  std::filesystem::rename(part_, path_, error);
  if (error) return CannotWrite(path_, error.message());
  part_.clear();
  return absl::OkStatus();
}

}  // namespace calib::ctl
