#pragma once
// A folder for files in between, gone with its object.

#include <string>

#include "absl/status/statusor.h"

namespace calib::client {

class TemporaryFolder {
 public:
  /// In $TMPDIR or /tmp. RESOURCE_EXHAUSTED when none can be made.
  static absl::StatusOr<TemporaryFolder> Make();
  ~TemporaryFolder();
  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder& operator=(TemporaryFolder&&) = delete;

  const std::string& path() const { return path_; }

 private:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

}  // namespace calib::client
