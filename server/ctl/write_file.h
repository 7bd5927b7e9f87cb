#pragma once
// Writing an answer to a file, all of it or an error that names the file.

#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace calib::ctl {

/// PERMISSION_DENIED with the path and the reason when it cannot be written.
absl::Status WriteFile(const std::string& path, const std::string& content);

/// A file that is there as a whole or as it was before. Not copyable.
class OutputFile {
 public:
  /// Makes PATH.PID.part beside the file, so that a place where nothing can be written is known
  /// before the work. What is there and is no regular file (a device, a pipe) is written to itself.
  /// PERMISSION_DENIED with the path and the reason.
  static absl::StatusOr<OutputFile> Open(const std::string& path);
  OutputFile(OutputFile&& other) noexcept
      : path_(std::move(other.path_)), part_(std::exchange(other.part_, "")) {}
  OutputFile& operator=(OutputFile&&) = delete;
  /// Without Put() the file stays as it was.
  ~OutputFile();

  /// Writes and renames. PERMISSION_DENIED as WriteFile; the file is then as it was.
  absl::Status Put(const std::string& content);

 private:
  OutputFile(std::string path, std::string part) : path_(std::move(path)), part_(std::move(part)) {}

  std::string path_;
  std::string part_;  ///< empty: written to itself, or renamed already
};

}  // namespace calib::ctl
