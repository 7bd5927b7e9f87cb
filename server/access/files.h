#pragma once
// Files that survive a kill, and folders that one process works on at a time. Errors name the path
// and the reason: NOT_FOUND, PERMISSION_DENIED, INVALID_ARGUMENT (longer than 4 MiB), or
// RESOURCE_EXHAUSTED where it cannot be written.

#include <sys/types.h>

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace calib::access {

inline constexpr mode_t kPublicFile = 0644;
inline constexpr mode_t kSecretFile = 0600;

absl::StatusOr<std::string> ReadFile(const std::string& path);
/// As ReadFile; PERMISSION_DENIED too where others than the owner may read or write the file.
absl::StatusOr<std::string> ReadSecret(const std::string& path);

/// Where a file is while it is written.
std::string DraftOf(const std::string& path);
/// Writes DraftOf(path), on disk when this returns. mode: of the file, whatever the umask.
absl::Status WriteDraft(const std::string& path, const std::string& content, mode_t mode);
/// Puts DraftOf(path) in the place of `path`; on disk after SyncFolder.
absl::Status PutDraft(const std::string& path);
absl::Status SyncFolder(const std::string& folder);
/// The three of them: `path` is the old file or the new one at any moment.
absl::Status ReplaceFile(const std::string& path, const std::string& content, mode_t mode);

/// Without slashes at its end.
std::string PlainFolder(const std::string& folder);
/// FAILED_PRECONDITION where others than the owner may change what is in the folder.
absl::Status CheckIsOwn(const std::string& folder);
/// A folder that only its owner may enter (mode 0700), and folders around it as needed. One that is
/// there keeps its mode, which CheckIsOwn judges.
absl::Status MakeOwnFolder(const std::string& folder);

/// A folder, locked for this object: threads and processes exclude each other.
class FolderLock {
 public:
  /// By its file `lock`. Waits up to 30 s; then RESOURCE_EXHAUSTED.
  static absl::StatusOr<FolderLock> Take(const std::string& folder);
  /// The same without a file: of a folder that is copied elsewhere.
  static absl::StatusOr<FolderLock> TakeItself(const std::string& folder);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&&) = delete;
  ~FolderLock();

 private:
  explicit FolderLock(int file) : file_(file) {}
  int file_;
};

}  // namespace calib::access
