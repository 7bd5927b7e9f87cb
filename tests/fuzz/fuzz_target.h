#pragma once
// What every target shares: its entry, and how it says that a promise was broken.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

/// One input; returns 0. Called by libFuzzer (preset fuzz) or by replay_main.cc. The same input
/// does the same whatever came before it.
// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer's name
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace calib::fuzz {

/// Whether the last input was good: accepted by what read it, every call answered. Files of the
/// corpus whose names begin with good_ have to be.
inline bool last_was_good = false;

inline std::string TextOf(const std::uint8_t* data, std::size_t size) {
  return {data, data + size};
}

/// Ends the program, which libFuzzer takes for a finding, where a promise does not hold.
inline void Expect(bool holds, const std::string& promise) {
  if (!holds) {
    std::fprintf(stderr, "broken promise: %s\n", promise.c_str());
    std::abort();
  }
}

}  // namespace calib::fuzz
