#include "server/service/upkeep/backup.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/return_if_error.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/digest.h"

namespace calib::service {
namespace {

constexpr const char* kName = "/backup";
constexpr double kMebibyte = 1024.0 * 1024.0;
/// That the server itself may need while the copy is made [bytes].
constexpr std::uintmax_t kLeftFree = std::uintmax_t{64} << 20;

absl::Status CheckRoom(const std::string& folder) {
  std::error_code error;
  std::uintmax_t bytes = kLeftFree;
  for (const char* file : {"/calib.db", "/calib.db-wal"}) {
    const auto size = std::filesystem::file_size(folder + file, error);
    bytes += error ? 0 : size;
  }
  const auto space = std::filesystem::space(folder, error);
  if (error || space.available >= bytes) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(absl::StrFormat(
      "a backup is first copied beside the state, which needs %.0f MiB, and %.0f MiB are free in "
      "%s: make room there",
      static_cast<double>(bytes) / kMebibyte, static_cast<double>(space.available) / kMebibyte,
      folder));
}

}  // namespace

void RemoveHalfBackup(const std::string& folder) {
  for (const char* end : {"", ".new", ".new-journal"}) {
    unlink(absl::StrCat(folder, kName, end).c_str());
  }
}

absl::StatusOr<std::unique_ptr<BackupCopy>> BackupCopy::Make(store::Reader& reader,
                                                             const std::string& folder,
                                                             const std::function<bool()>& goes_on) {
  RETURN_IF_ERROR(CheckRoom(folder));
  const std::string path = folder + kName;
  RETURN_IF_ERROR(reader.CopyTo(path, goes_on));
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const int error = errno;
  unlink(path.c_str());  // it goes with this process, however that ends
  if (file < 0) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path, ": ", std::generic_category().message(error)));
  }
  std::unique_ptr<BackupCopy> copy(new BackupCopy(file));
  rpc::Sha256 digest;
  while (true) {
    ASSIGN_OR_RETURN(const std::string piece, copy->Next(rpc::kChunkBytes));
    if (piece.empty()) break;
    if (!goes_on()) return absl::CancelledError("the copy was not finished");
    digest.Update(piece);
  }
  copy->digest_ = digest.Finish();
  copy->bytes_ = copy->read_;
  copy->read_ = 0;
  return copy;
}

BackupCopy::~BackupCopy() { close(file_); }

absl::StatusOr<std::string> BackupCopy::Next(std::size_t most) {
  std::string piece(most, '\0');
  ssize_t count = -1;
  do {
    count = pread(file_, piece.data(), piece.size(), read_);
  } while (count < 0 && errno == EINTR);
  if (count < 0) {
    return absl::DataLossError(
        absl::StrCat("the copy cannot be read: ", std::generic_category().message(errno)));
  }
  piece.resize(static_cast<std::size_t>(count));
  read_ += count;
  return piece;
}

}  // namespace calib::service
