#include "server/access/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/return_if_error.h"

namespace calib::access {
namespace {

constexpr std::size_t kLongestFile = std::size_t{4} << 20;  // [bytes]
constexpr mode_t kOthers = 077;
constexpr mode_t kWriteOfOthers = 022;
constexpr mode_t kOwnFolder = 0700;
constexpr absl::Duration kLongestWait = absl::Seconds(30);
constexpr absl::Duration kLockPause = absl::Milliseconds(5);

std::string WhyNot(int error) { return std::generic_category().message(error); }

absl::Status CannotRead(const std::string& path, int error) {
  if (error == ENOENT || error == ENOTDIR) {
    return absl::NotFoundError(absl::StrCat(path, " is not there"));
  }
  return absl::PermissionDeniedError(absl::StrCat(path, " cannot be read: ", WhyNot(error)));
}

absl::Status CannotWrite(const std::string& path, int error) {
  const std::string message = absl::StrCat(path, " cannot be written: ", WhyNot(error));
  return error == EACCES || error == EPERM || error == EROFS
             ? absl::PermissionDeniedError(message)
             : absl::ResourceExhaustedError(message);
}

/// A descriptor that is closed with its object.
class OpenFile {
 public:
  explicit OpenFile(int file) : file_(file) {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() {
    if (file_ >= 0) close(file_);
  }
  int get() const { return file_; }

 private:
  int file_;
};

absl::StatusOr<std::string> ReadAllOf(const std::string& path, bool secret) {
  const OpenFile file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat found = {};
  if (file.get() < 0 || fstat(file.get(), &found) != 0) return CannotRead(path, errno);
  if (secret && (found.st_mode & kOthers) != 0) {
    return absl::PermissionDeniedError(
        absl::StrCat(path, " may be read by others than its owner, which a key must not be: chmod ",
                     "600 ", path));
  }
  std::string content;
  std::array<char, 16384> piece{};
  for (;;) {
    const ssize_t got = read(file.get(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return CannotRead(path, errno);
    if (got == 0) return content;
    content.append(piece.data(), static_cast<std::size_t>(got));
    if (content.size() > kLongestFile) {
      return absl::InvalidArgumentError(absl::StrCat(path, " is longer than 4 MiB"));
    }
  }
}

/// Calls `take` until it gives 0, or says that it never will.
template <typename Take>
absl::Status WaitForLock(const std::string& folder, const std::string& path, const Take& take) {
  for (absl::Duration waited;; waited += kLockPause) {  // no clock that may be set meanwhile
    if (take() == 0) return absl::OkStatus();
    if (errno != EAGAIN && errno != EACCES && errno != EINTR) return CannotWrite(path, errno);
    if (waited > kLongestWait) {
      return absl::ResourceExhaustedError(
          absl::StrCat("another process has been working on ", folder, " for ",
                       absl::FormatDuration(kLongestWait), ": try again when it has ended"));
    }
    absl::SleepFor(kLockPause);
  }
}

}  // namespace

absl::StatusOr<std::string> ReadFile(const std::string& path) { return ReadAllOf(path, false); }
absl::StatusOr<std::string> ReadSecret(const std::string& path) { return ReadAllOf(path, true); }

std::string DraftOf(const std::string& path) { return path + ".new"; }

absl::Status WriteDraft(const std::string& path, const std::string& content, mode_t mode) {
  const std::string draft = DraftOf(path);
  // One that a kill has left may have another mode: it is never written to.
  if (unlink(draft.c_str()) != 0 && errno != ENOENT) return CannotWrite(path, errno);
  const OpenFile file(open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode));
  if (file.get() < 0 || fchmod(file.get(), mode) != 0) return CannotWrite(path, errno);
  for (std::size_t written = 0; written < content.size();) {
    const ssize_t put = write(file.get(), content.data() + written, content.size() - written);
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) return CannotWrite(path, errno);
    written += static_cast<std::size_t>(put);
  }
  return fsync(file.get()) == 0 ? absl::OkStatus() : CannotWrite(path, errno);
}

absl::Status PutDraft(const std::string& path) {
  return std::rename(DraftOf(path).c_str(), path.c_str()) == 0 ? absl::OkStatus()
                                                               : CannotWrite(path, errno);
}

absl::Status SyncFolder(const std::string& folder) {
  const OpenFile file(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return file.get() >= 0 && fsync(file.get()) == 0 ? absl::OkStatus() : CannotWrite(folder, errno);
}

absl::Status ReplaceFile(const std::string& path, const std::string& content, mode_t mode) {
  RETURN_IF_ERROR(WriteDraft(path, content, mode));
  RETURN_IF_ERROR(PutDraft(path));
  return SyncFolder(std::filesystem::path(path).parent_path().string());
}

std::string PlainFolder(const std::string& folder) {
  const std::size_t last = folder.find_last_not_of('/');
  return last == std::string::npos ? folder : folder.substr(0, last + 1);
}

absl::Status CheckIsOwn(const std::string& folder) {
  struct stat found = {};
  if (stat(folder.c_str(), &found) != 0) return CannotRead(folder, errno);
  if ((found.st_mode & kWriteOfOthers) == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(folder, " may be changed by others than its owner: chmod 700 ", folder));
}

absl::Status MakeOwnFolder(const std::string& folder) {
  const std::filesystem::path around = std::filesystem::path(PlainFolder(folder)).parent_path();
  std::error_code error;
  if (!around.empty()) std::filesystem::create_directories(around, error);
  if (error) return CannotWrite(around.string(), error.value());
  if (mkdir(folder.c_str(), kOwnFolder) == 0) return absl::OkStatus();
  const int why = errno;
  if (why == EEXIST && std::filesystem::is_directory(folder, error)) return CheckIsOwn(folder);
  return CannotWrite(folder, why);
}

absl::StatusOr<FolderLock> FolderLock::Take(const std::string& folder) {
  const std::string path = folder + "/lock";
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kSecretFile);
  if (file < 0) return CannotWrite(path, errno);
  FolderLock lock(file);
  RETURN_IF_ERROR(WaitForLock(folder, path, [file] {
    struct flock exclusive = {};
    exclusive.l_type = F_WRLCK;
    exclusive.l_whence = SEEK_SET;
    return fcntl(file, F_OFD_SETLK, &exclusive);
  }));
  return lock;
}

absl::StatusOr<FolderLock> FolderLock::TakeItself(const std::string& folder) {
  const int file = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return CannotRead(folder, errno);
  FolderLock lock(file);
  RETURN_IF_ERROR(WaitForLock(folder, folder, [file] { return flock(file, LOCK_EX | LOCK_NB); }));
  return lock;
}

FolderLock::FolderLock(FolderLock&& other) noexcept : file_(std::exchange(other.file_, -1)) {}

FolderLock::~FolderLock() {
  if (file_ >= 0) close(file_);
}

}  // namespace calib::access
