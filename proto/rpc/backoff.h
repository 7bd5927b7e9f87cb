#pragma once
// Waiting times between attempts at a call.

#include <chrono>
#include <cstdint>
#include <random>

namespace calib::rpc {

struct BackoffOptions {
  std::chrono::milliseconds first{100};
  std::chrono::milliseconds longest{10'000};
  double factor = 2;  ///< growth from one wait to the next, > 1
};

/// Exponential backoff with full jitter: wait k is uniform in (0, min(longest, first * factor^k)],
/// so that many workers that lost one server do not come back in step. Not thread-safe.
class Backoff {
 public:
  explicit Backoff(BackoffOptions options, std::uint64_t seed = std::random_device{}());
  std::chrono::milliseconds Next();
  /// After a success: the next wait is short again.
  void Reset();

 private:
  BackoffOptions options_;
  std::minstd_rand random_;
  double ceiling_ms_;
};

}  // namespace calib::rpc
