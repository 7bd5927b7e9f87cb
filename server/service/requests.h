#pragma once
// Calls that change something carry a request_id: the same id with the same content gets the first
// answer again.

#include <optional>
#include <set>
#include <string>

#include "absl/status/statusor.h"
#include "server/store/reader.h"

namespace calib::service {

/// Which requests are being carried out. Not thread-safe: it is used on the strand only.
class Requests {
 public:
  /// The stored answer if the request was carried out before; nothing if it is new, and then it is
  /// in progress until Done(). ALREADY_EXISTS: same id, other content. UNAVAILABLE: the first one
  /// is still in progress (retry). INVALID_ARGUMENT: an id longer than 193 characters, whose it is
  /// included. An empty id
  /// is always new.
  absl::StatusOr<std::optional<std::string>> Begin(const std::string& id, const std::string& digest,
                                                   store::Reader& reader);
  void Done(const std::string& id) { in_progress_.erase(id); }

 private:
  std::set<std::string> in_progress_;
};

}  // namespace calib::service
