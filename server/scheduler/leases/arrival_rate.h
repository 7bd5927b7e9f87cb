#pragma once
// How many states a second come in.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <utility>

namespace calib::scheduler {

/// Counts by seconds of a steady clock. Not thread-safe.
class ArrivalRate {
 public:
  using Time = std::chrono::steady_clock::time_point;

  void Add(Time now, std::int64_t states) {
    Forget(now);
    counts_[Place(last_)] += states;
    flows_ = true;
  }
  /// Whether the last states are longer ago than PerSecond() looks back; true once after each time
  /// that some came in.
  bool HasCeased(Time now) {
    Forget(now);
    return std::all_of(counts_.begin(), counts_.end(), [](std::int64_t n) { return n == 0; }) &&
           std::exchange(flows_, false);
  }
  /// Per second, over the last kWindow whole seconds or, where it was first asked or told less long
  /// ago, over those; 0 before a second is over.
  double PerSecond(Time now) {
    Forget(now);
    const std::int64_t seconds = std::min<std::int64_t>(kWindow, last_ - first_);
    if (seconds == 0) {
      return 0;
    }
    std::int64_t sum = 0;
    for (std::int64_t second = last_ - seconds; second < last_; ++second) {
      sum += counts_[Place(second)];
    }
    return static_cast<double>(sum) / static_cast<double>(seconds);
  }

 private:
  static constexpr std::int64_t kWindow = 10;  // [s] long enough to be calm, short enough to be now
  static std::size_t Place(std::int64_t second) {
    return static_cast<std::size_t>(second % (kWindow + 1));
  }
  void Forget(Time now) {
    const std::int64_t second =
        std::chrono::duration_cast<std::chrono::seconds>(now.time_since_epoch()).count();
    if (first_ < 0) {
      first_ = last_ = second;
    }
    if (second - last_ > kWindow) {
      counts_.fill(0);
      last_ = second;
    }
    while (last_ < second) {
      counts_[Place(++last_)] = 0;
    }
  }

  std::array<std::int64_t, kWindow + 1> counts_{};  // the second that goes on among them
  std::int64_t first_ = -1;
  std::int64_t last_ = -1;
  bool flows_ = false;
};

}  // namespace calib::scheduler
