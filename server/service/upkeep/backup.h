#pragma once
// A backup of a running server: a copy of its state as it is at one moment, read a piece at a time.

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/store/reader.h"

namespace calib::service {

/// Not thread-safe.
class BackupCopy {
 public:
  /// Copies all that `reader` sees to a file without a name in the folder, which takes as long as
  /// the state is large. goes_on: asked now and then. RESOURCE_EXHAUSTED: no room beside the state;
  /// CANCELLED: it was not to go on; DATA_LOSS: what is stored is damaged.
  static absl::StatusOr<std::unique_ptr<BackupCopy>> Make(store::Reader& reader,
                                                          const std::string& folder,
                                                          const std::function<bool()>& goes_on);
  ~BackupCopy();
  BackupCopy(const BackupCopy&) = delete;
  BackupCopy& operator=(const BackupCopy&) = delete;

  const std::string& digest() const { return digest_; }  ///< SHA-256 of all of it
  std::int64_t bytes() const { return bytes_; }
  /// The next bytes, at most so many; none at the end.
  absl::StatusOr<std::string> Next(std::size_t most);

 private:
  explicit BackupCopy(int file) : file_(file) {}

  const int file_;
  std::int64_t bytes_ = 0;
  std::int64_t read_ = 0;
  std::string digest_;
};

/// Removes what a backup has left in a state folder whose server was killed.
void RemoveHalfBackup(const std::string& folder);

}  // namespace calib::service
