#pragma once
// What the store counts and measures while it runs, for those who watch a server.

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "server/store/records.h"

namespace calib::store {

/// How long something took, by the bounds that it stayed within. Add() and Read() on any thread.
class Durations {
 public:
  /// [s]. Chosen: from a commit of a fast disk to what nobody waits for any longer.
  static constexpr std::array kBounds = {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1,
                                         0.25,  0.5,    1.0,   2.5,  5.0,   10.0};
  struct Counts {
    /// Of each bound those within it and beyond the one before; at the end those beyond all.
    std::array<std::uint64_t, kBounds.size() + 1> within{};
    double seconds = 0;  ///< of all together
  };

  void Add(std::chrono::steady_clock::duration took) {
    const double seconds = std::chrono::duration<double>(took).count();
    std::size_t k = 0;
    while (k < kBounds.size() && seconds > kBounds[k]) ++k;
    within_[k].fetch_add(1, std::memory_order_relaxed);
    nanoseconds_.fetch_add(std::chrono::duration_cast<std::chrono::nanoseconds>(took).count(),
                           std::memory_order_relaxed);
  }
  Counts Read() const {
    Counts counts;
    for (std::size_t k = 0; k < within_.size(); ++k) {
      counts.within[k] = within_[k].load(std::memory_order_relaxed);
    }
    counts.seconds = 1e-9 * static_cast<double>(nanoseconds_.load(std::memory_order_relaxed));
    return counts;
  }

 private:
  std::array<std::atomic<std::uint64_t>, kBounds.size() + 1> within_{};
  std::atomic<std::int64_t> nanoseconds_{0};
};

/// What transactions have written.
struct Tally {
  std::array<std::uint64_t, kAttemptOutcomes> ended{};  ///< attempts, by outcome
  std::uint64_t states = 0;                             ///< that were not there before

  void Add(const Tally& other) {
    for (std::size_t k = 0; k < ended.size(); ++k) ended[k] += other.ended[k];
    states += other.states;
  }
};

/// Since the store was opened.
struct StoreNumbers {
  Tally written{};              ///< that is on disk
  Durations::Counts commits{};  ///< from the begin of a transaction until it is on disk
  std::size_t waiting = 0;      ///< writes that wait for the next commit
  std::int64_t file_bytes = 0;
  std::int64_t wal_bytes = 0;  ///< of the log beside the file
};

}  // namespace calib::store
