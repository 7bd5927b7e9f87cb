#pragma once
// What a run may take at most, and whether it has come to that.

#include <chrono>
#include <string>

#include "calib/v1/worker.pb.h"

namespace calib::worker {

/// "1000 MB"
std::string SizeInWords(double bytes);

/// Of one run, which begins when this is made. Each question is answered by a sentence about the
/// limit, or nothing. Not thread-safe.
class RunLimits {
 public:
  using Clock = std::chrono::steady_clock;

  explicit RunLimits(const v1::ProgramLimits& limits) : limits_(limits) {}

  /// It has come to a state.
  void Progressed(Clock::time_point now) { last_state_ = now; }
  /// It was kept waiting by others for this long, which does not count.
  void Waited(Clock::duration time) {
    begin_ += time;
    last_state_ += time;
  }
  /// resident: of all its processes [bytes]. Above its limit in two looks: between fork and exec a
  /// child counts its parent's pages for a moment.
  std::string AtMemory(double resident);
  /// Of wall time and silence.
  std::string AtTime(Clock::time_point now) const;

 private:
  const v1::ProgramLimits limits_;
  Clock::time_point begin_ = Clock::now();
  Clock::time_point last_state_ = begin_;
  bool was_above_ = false;
};

}  // namespace calib::worker
