#pragma once
// What one engine of a worker has fetched or made, for the others: files in a folder that they
// share.

#include <functional>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"

namespace calib::worker {

/// One making at a time for each key, by whichever process is first; it may die of it, and the next
/// one makes it. Thread-safe, also between processes.
class SharedContent {
 public:
  /// folder: exists, and goes when its worker goes. Empty: nothing is shared.
  explicit SharedContent(std::string folder) : folder_(std::move(folder)) {}

  using Make = std::function<absl::StatusOr<std::string>()>;
  /// The content under a key (at most 200 letters and digits), made if nobody has. Errors: those of
  /// `make`, which are not kept; CANCELLED: told to stop while another one makes it. Where the
  /// folder cannot be used it is made here.
  absl::StatusOr<std::string> Get(const std::string& key, const std::stop_token& stop,
                                  const Make& make) const;

 private:
  std::string folder_;
};

}  // namespace calib::worker
