#pragma once
// An attempt this worker answers for, from its lease until the server has acknowledged its end.

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "calib/v1/worker.pb.h"
#include "worker/engine/engines.h"
#include "worker/program/programs.h"

namespace calib::worker {

/// Keeps what is not acknowledged and says what is to be sent next. Owned by one strand; the
/// simulation runs on a thread of its own that only calls the two functions given to Run().
class HeldAttempt {
 public:
  explicit HeldAttempt(v1::Lease lease);

  /// Starts the run, of the DEM or of a program, as the lease has it. on_state and on_end are
  /// called on its thread. Everything outlives it.
  void Run(Engines& engines, Programs& programs, std::function<void(v1::State)> on_state,
           std::function<void(v1::Finished)> on_end);
  bool started() const { return thread_.joinable(); }
  /// True from Run() until the end has been handed to AddEnd().
  bool running() const { return started() && !end_.has_value(); }
  bool ended() const { return end_.has_value(); }
  /// It is not wanted any more.
  void Stop() { thread_.request_stop(); }
  /// It goes on elsewhere: from here, where its engine can.
  void Leave() { lease_.has_program() ? Stop() : static_cast<void>(leave_.request_stop()); }

  void AddState(v1::State state);
  void AddEnd(v1::Finished finished);

  /// States not yet sent over the present stream, in batches.
  std::vector<v1::StateBatch> TakeUnsentStates();
  /// Messages not yet sent over the present stream: batches of states, then the end.
  std::vector<v1::WorkerMessage> TakeUnsent();
  /// A new stream knows nothing: everything that is not acknowledged is unsent again.
  void StreamLost();
  /// The server has stored states up to this position; it need not be told again.
  void Acknowledge(std::int64_t up_to);

 private:
  v1::Lease lease_;
  std::deque<v1::State> kept_;  // not acknowledged; kept_[0] has position first_
  std::int64_t first_ = 0;
  std::int64_t next_ = 0;  // position of the first state not yet sent
  std::optional<v1::Finished> end_;
  bool end_sent_ = false;
  std::stop_source leave_;
  std::jthread thread_;  // last: joined before the rest goes
};

}  // namespace calib::worker
