#include "server/restore.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/digest.h"
#include "server/messages/backup_seal.h"
#include "server/service/state_folder.h"
#include "server/store/whole_copy.h"

namespace calib {
namespace {

constexpr const char* kDraft = "/calib.db.restoring";

/// A file that is open; closed with its object.
class OpenFile {
 public:
  OpenFile(const std::string& path, int flags)
      : file_(open(path.c_str(), flags | O_CLOEXEC, 0600)) {}
  ~OpenFile() {
    if (file_ >= 0) close(file_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int get() const { return file_; }

 private:
  const int file_;
};

absl::Status CannotRead(const std::string& path, int error) {
  const std::string text = absl::StrCat(path, ": ", std::generic_category().message(error));
  return error == ENOENT ? absl::NotFoundError(text) : absl::PermissionDeniedError(text);
}

/// Calls `take` with pieces of the first `bytes` of a file, in order.
absl::Status ReadPieces(int file, const std::string& path, std::int64_t bytes,
                        const std::function<absl::Status(std::string_view)>& take) {
  std::string buffer(rpc::kChunkBytes, '\0');
  for (std::int64_t at = 0; at < bytes;) {
    const auto most = static_cast<std::size_t>(
        std::min<std::int64_t>(bytes - at, static_cast<std::int64_t>(buffer.size())));
    const ssize_t count = pread(file, buffer.data(), most, at);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return CannotRead(path, errno);
    if (count == 0) return absl::DataLossError(absl::StrCat(path, " has become shorter"));
    RETURN_IF_ERROR(take(std::string_view(buffer.data(), static_cast<std::size_t>(count))));
    at += count;
  }
  return absl::OkStatus();
}

/// The seal of a backup that is as it was taken.
absl::StatusOr<messages::BackupSeal> CheckSeal(int file, const std::string& path) {
  struct stat status = {};
  if (fstat(file, &status) != 0) return CannotRead(path, errno);
  const std::int64_t length = status.st_size;
  std::string tail(static_cast<std::size_t>(messages::kSealBytes), '\0');
  const std::int64_t bytes = length - messages::kSealBytes;
  const bool is_read = S_ISREG(status.st_mode) && bytes >= 0 &&
                       pread(file, tail.data(), tail.size(), bytes) == messages::kSealBytes;
  const auto seal = is_read ? messages::ParseSeal(tail) : std::nullopt;
  if (!seal.has_value() || seal->bytes != bytes) {
    return absl::DataLossError(absl::StrCat(
        path, " is no backup of `calibctl backup`, or its end is missing; nothing was restored"));
  }
  rpc::Sha256 digest;
  RETURN_IF_ERROR(ReadPieces(file, path, bytes, [&digest](std::string_view piece) {
    digest.Update(piece);
    return absl::OkStatus();
  }));
  if (digest.Finish() != seal->digest) {
    return absl::DataLossError(
        absl::StrCat(path,
                     " is damaged: its content is not what was backed up (SHA-256); nothing "
                     "was restored"));
  }
  return *seal;
}

/// What a folder holds besides what a restore that was killed has left; empty: nothing.
std::string Held(const std::string& folder) {
  static const std::set<std::string> kLeft = {"lock", "calib.db.restoring",
                                              "calib.db.restoring-journal"};
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::string name = entry->path().filename().string();
    if (!kLeft.contains(name)) return name;
  }
  return error && error != std::errc::no_such_file_or_directory ? error.message() : "";
}

absl::Status CopyTo(const std::string& draft, int file, const std::string& path,
                    std::int64_t bytes) {
  unlink(draft.c_str());
  const OpenFile copy(draft, O_WRONLY | O_CREAT | O_EXCL);
  const auto cannot = [&draft](int error) {
    return absl::ResourceExhaustedError(
        absl::StrCat(draft, " cannot be written: ", std::generic_category().message(error),
                     "; nothing was restored"));
  };
  if (copy.get() < 0) return cannot(errno);
  RETURN_IF_ERROR(ReadPieces(file, path, bytes, [&](std::string_view piece) {
    while (!piece.empty()) {
      const ssize_t count = write(copy.get(), piece.data(), piece.size());
      if (count < 0 && errno != EINTR) return cannot(errno);
      piece.remove_prefix(count > 0 ? static_cast<std::size_t>(count) : 0);
    }
    return absl::OkStatus();
  }));
  return fsync(copy.get()) == 0 ? absl::OkStatus() : cannot(errno);
}

absl::StatusOr<std::int64_t> MakeDatabase(const std::string& folder, int file,
                                          const std::string& path, std::int64_t bytes) {
  const std::string draft = folder + kDraft;
  RETURN_IF_ERROR(CopyTo(draft, file, path, bytes));
  auto campaigns = store::MakeServable(draft);
  if (!campaigns.ok()) {
    return absl::Status(campaigns.status().code(),
                        absl::StrCat(path, " cannot be restored: ", campaigns.status().message(),
                                     "; nothing was restored"));
  }
  RETURN_IF_ERROR(store::SyncFile(draft));
  if (std::rename(draft.c_str(), (folder + "/calib.db").c_str()) != 0) {
    return CannotRead(draft, errno);
  }
  RETURN_IF_ERROR(store::SyncFile(folder));
  return campaigns;
}

}  // namespace

absl::StatusOr<std::int64_t> Restore(const std::string& file, const std::string& state_dir) {
  const OpenFile backup(file, O_RDONLY);
  if (backup.get() < 0) return CannotRead(file, errno);
  std::error_code error;
  const bool is_new = !std::filesystem::exists(state_dir, error);
  if (const std::string held = Held(state_dir); !held.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(state_dir, " is not empty (", held,
                     "): a backup is restored to a new or an empty folder; nothing was restored"));
  }
  ASSIGN_OR_RETURN(const auto seal, CheckSeal(backup.get(), file));
  absl::StatusOr<std::int64_t> campaigns;
  {
    ASSIGN_OR_RETURN(const auto folder, service::StateFolder::Open(state_dir));
    campaigns = MakeDatabase(state_dir, backup.get(), file, seal.bytes);
    if (campaigns.ok()) return campaigns;
    for (const char* left : {kDraft, "/calib.db.restoring-journal", "/lock"}) {
      unlink((state_dir + left).c_str());
    }
  }
  if (is_new) rmdir(state_dir.c_str());
  return campaigns;
}

}  // namespace calib
