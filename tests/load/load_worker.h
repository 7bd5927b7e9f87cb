#pragma once
// A worker without mechanics that sends states at a given rate and measures how long each takes to
// be acknowledged.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "proto/rpc/access.h"

namespace calib::load {

using Clock = std::chrono::steady_clock;

struct Load {
  std::string address;
  rpc::Access access;
  int slots = 1;
  double states_per_second = 1;  ///< of one slot, > 0
};

/// What a worker has seen since it was told to count.
struct Seen {
  std::vector<float> waits_ms{};  ///< from the birth of a state to its acknowledgement
  std::int64_t finished = 0;      ///< runs whose end was acknowledged
  std::int64_t refused = 0;       ///< runs whose lease was lost
  std::string ended{};            ///< why the stream has ended; empty: it has not
};

/// Thread-safe; Tick() from one thread at a time.
class LoadWorker {
 public:
  /// Opens the stream at once.
  LoadWorker(const std::string& name, const Load& load);
  /// Cuts the stream and waits for its end.
  ~LoadWorker();
  LoadWorker(const LoadWorker&) = delete;
  LoadWorker& operator=(const LoadWorker&) = delete;

  /// Sends the states that are due by now, and a heartbeat when it is.
  void Tick(Clock::time_point now);
  /// From now on acknowledgements count.
  void Count();
  Seen Take();

 private:
  class Stream;
  std::unique_ptr<Stream> stream_;
};

}  // namespace calib::load
