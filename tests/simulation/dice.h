#pragma once
// The one source of chance of a simulation: the same seed, the same throws, on any machine.

#include <cstdint>

namespace calib::simulation {

/// SplitMix64 [Steele, Lea & Flood 2014]. Two throws are two statements: in which order arguments of
/// one call are thrown is the compiler's choice. Not thread-safe.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}

  std::uint64_t Next() {
    std::uint64_t mixed = state_ += 0x9E3779B97F4A7C15U;
    mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9U;
    mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBU;
    return mixed ^ (mixed >> 31);
  }
  /// From 0 to n - 1; n > 0.
  int Below(int n) { return static_cast<int>(Next() % static_cast<std::uint64_t>(n)); }
  /// From low to high, both included.
  int Between(int low, int high) { return low + Below(high - low + 1); }
  /// Once in n times, n > 0.
  bool OnceIn(int n) { return Below(n) == 0; }

 private:
  std::uint64_t state_;
};

}  // namespace calib::simulation
