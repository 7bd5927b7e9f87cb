#pragma once
// Who comes in: every call passes here before anything looks at it. A peer (one connection) has so
// many calls open at a time, its messages keep the rules of their fields
// (proto/rpc/check_message.h), and what is turned away is said in the log, once.

#include <chrono>
#include <map>
#include <memory>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "google/protobuf/message.h"
#include "server/service/limits.h"

namespace calib::service {

/// Thread-safe.
class Door {
 public:
  using Clock = std::chrono::steady_clock;
  /// The right to one call; it ends when the last copy goes, before its door.
  using Pass = std::shared_ptr<const void>;

  explicit Door(const Limits& limits) : limits_(limits) {}

  /// peer: as gRPC names it. RESOURCE_EXHAUSTED: it has as many calls open as it may.
  absl::StatusOr<Pass> Enter(const std::string& peer);
  /// The same of a call that carries a content, of which fewer may be open.
  absl::StatusOr<Pass> EnterWithBlob(const std::string& peer);

  /// Whether a message keeps its rules; one that does not is logged.
  absl::Status Check(const std::string& peer, const google::protobuf::Message& message);
  /// Logs what was turned away: the first time from an address for this reason, and again after a
  /// minute.
  void LogRefusal(const std::string& peer, const absl::Status& why);

  const Limits& limits() const { return limits_; }

 private:
  struct Open {
    int calls = 0;
    int blobs = 0;
  };
  absl::StatusOr<Pass> Count(const std::string& peer, bool with_blob);
  void Leave(const std::string& peer, bool with_blob);

  const Limits limits_;
  absl::Mutex mutex_;
  std::map<std::string, Open> open_ ABSL_GUARDED_BY(mutex_);  // by peer; none: nothing is open
  int blobs_ ABSL_GUARDED_BY(mutex_) = 0;                     // of all peers
  std::map<std::string, Clock::time_point> said_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace calib::service
