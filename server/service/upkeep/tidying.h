#pragma once
// Removes what nobody needs any more, in pieces between the writes of others, and gives the room
// back to the file system: rows of campaigns that were deleted or pruned, contents without a name.

#include <chrono>
#include <cstdint>
#include <functional>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/store.h"

namespace calib::service {

/// Lives on one strand. Whenever the process ends, the next one goes on from what the store holds.
class Tidying {
 public:
  /// A content that was put and has no name stays for so long: who put it will name it soon.
  static constexpr std::chrono::hours kUnnamedStays{24};

  struct Site {
    /// Store::Write, its answer on the strand.
    std::function<void(store::Store::Job, std::function<void(const absl::Status&)>)> write;
    std::function<absl::StatusOr<store::Reader>()> read;
    /// Runs on a thread that may wait, then what it has returned on the strand.
    std::function<void(std::function<std::function<void()>()>)> aside;
    /// Runs on the strand after a pause; never once the server goes down.
    std::function<void(std::chrono::steady_clock::duration, std::function<void()>)> after;
    std::function<std::int64_t()> unix_ms;
  };
  explicit Tidying(Site site) : site_(std::move(site)) {}

  /// Removes all that is to be removed by now; once more from the start where it is doing so.
  void Begin();
  /// Contents without a name that were put before this moment may go.
  std::int64_t PutBefore() const;

 private:
  void Rows();
  void Contents();
  void Pages();
  void End();
  /// Writes a piece, then goes on, after a pause as long as the piece took: half of the store's
  /// time is others', whatever is removed. Where it cannot be written, ends until the next Begin().
  void Write(store::Store::Job piece, std::function<void()> go_on);

  const Site site_;
  bool tidies_ = false;
  bool again_ = false;
};

}  // namespace calib::service
