#include "dem/simulate/whole_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::dem {
namespace {

/// Writes and syncs; false with errno set.
bool Fill(int file, const std::string& content) {
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t wrote = write(file, content.data() + done, content.size() - done);
    if (wrote < 0 && errno != EINTR) {
      return false;
    }
    done += wrote > 0 ? static_cast<std::size_t>(wrote) : 0;
  }
  return fsync(file) == 0;
}

}  // namespace

absl::Status WriteWholeFile(const std::string& path, const std::string& content) {
  // Two processes that write the same name do not write into each other's file.
  const std::string beside = absl::StrCat(path, ".", getpid(), ".part");
  const int file = open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  int error = file < 0 ? errno : 0;
  if (file >= 0) {
    error = Fill(file, content) ? 0 : errno;
    if (close(file) != 0 && error == 0) {
      error = errno;
    }
    if (error == 0 && std::rename(beside.c_str(), path.c_str()) != 0) {
      error = errno;
    }
    if (error != 0) {
      unlink(beside.c_str());
    }
  }
  return error == 0 ? absl::OkStatus()
                    : absl::UnavailableError(absl::StrCat("cannot write ", path, ": ",
                                                          std::generic_category().message(error)));
}

}  // namespace calib::dem
