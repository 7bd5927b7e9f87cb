#include "worker/engine/shared_content.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "worker/program/scratch.h"

namespace calib::worker {
namespace {

/// Between looks whether another one is through. chosen: little beside the second that a specimen
/// takes
constexpr std::chrono::milliseconds kBetweenTries{20};

std::optional<std::string> ContentAt(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  return std::string{std::istreambuf_iterator<char>(file), {}};
}

/// A lock of a file, which the end of its process frees as well.
class FileLock {
 public:
  explicit FileLock(const std::string& path)
      : file_(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {}
  ~FileLock() {
    if (file_ >= 0) close(file_);
  }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  bool can_lock() const { return file_ >= 0; }
  bool Try() const { return flock(file_, LOCK_EX | LOCK_NB) == 0; }

 private:
  const int file_;
};

}  // namespace

absl::StatusOr<std::string> SharedContent::Get(const std::string& key, const std::stop_token& stop,
                                               const Make& make) const {
  if (folder_.empty()) return make();
  const std::string path = absl::StrCat(folder_, "/", key);
  if (auto there = ContentAt(path); there.has_value()) return *std::move(there);
  const FileLock lock(path + ".lock");
  if (!lock.can_lock()) return make();
  while (!lock.Try()) {
    if (stop.stop_requested()) return absl::CancelledError("stopped");
    std::this_thread::sleep_for(kBetweenTries);
  }
  if (auto there = ContentAt(path); there.has_value()) return *std::move(there);
  ASSIGN_OR_RETURN(std::string content, make());
  // One that the disk does not take is made again by the next.
  WriteFileBelow(path, content).IgnoreError();
  return content;
}

}  // namespace calib::worker
