#pragma once
// Calls that change something carry a request_id: the same id with the same content gets the first
// answer again.

#include <optional>
#include <set>
#include <string>

#include "absl/status/statusor.h"
#include "server/service/guard.h"
#include "server/store/reader.h"

namespace calib::service {

/// Under what a caller's request is remembered: operators act for everybody and have one memory,
/// others each their own, so that nobody is answered with what somebody else has asked for. Empty
/// for an empty id.
std::string RequestKey(const Caller& caller, const std::string& id);

/// Which requests are being carried out. Not thread-safe: it is used on the strand only.
class Requests {
 public:
  /// The stored answer if the request was carried out before; nothing if it is new, and then it is
  /// in progress until Done(). ALREADY_EXISTS: same id, other content. UNAVAILABLE: the first one
  /// is still in progress (retry). key: RequestKey(); an empty one is always new.
  absl::StatusOr<std::optional<std::string>> Begin(const std::string& key,
                                                   const std::string& digest,
                                                   store::Reader& reader);
  void Done(const std::string& key) { in_progress_.erase(key); }

 private:
  std::set<std::string> in_progress_;
};

}  // namespace calib::service
