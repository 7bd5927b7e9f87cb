#pragma once
// What the scheduler needs from its surroundings, so that tests can run it without threads, sockets
// or time.

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "calib/v1/worker.pb.h"
#include "server/store/store.h"

namespace calib::scheduler {

/// Everything is called on the scheduler's strand, and every continuation is run there.
class Ports {
 public:
  virtual ~Ports() = default;

  /// Writes; `then` runs once the outcome is known: OK means on disk, INVALID_ARGUMENT that the
  /// store refuses these rows and has what it had. Writes keep their order.
  virtual void Write(store::Store::Job job, std::function<void(const absl::Status&)> then) = 0;
  /// On any thread.
  virtual absl::StatusOr<store::Reader> Read() = 0;
  /// Runs `work` aside; the function it returns is run on the strand.
  virtual void Compute(std::function<std::function<void()>()> work) = 0;
  /// The same of what takes seconds, not the minutes of a plan.
  virtual void Load(std::function<std::function<void()>()> work) = 0;
  /// On the strand, after what waits there.
  virtual void Later(std::function<void()> task) = 0;
  /// To the worker's stream of this session; ignored if that is gone.
  virtual void Send(std::int64_t session, v1::ServerMessage message) = 0;
  /// Ends a stream (a worker that came back over a new one).
  virtual void Close(std::int64_t session, const absl::Status& status) = 0;

  virtual std::chrono::steady_clock::time_point Now() = 0;
  virtual std::int64_t UnixMs() = 0;
};

}  // namespace calib::scheduler
