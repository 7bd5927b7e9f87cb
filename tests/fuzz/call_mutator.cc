// How libFuzzer changes a sequence of calls: one message at a time, so that lengths stay right, or
// the order of the calls. Sequences in words become bytes.

#include <algorithm>
#include <cstring>
#include <random>

#include "tests/fuzz/call_sequence.h"

// NOLINTBEGIN(readability-identifier-naming): libFuzzer's names
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned seed) {
  using calib::fuzz::Call;
  constexpr std::size_t kGrowth = 64;
  std::minstd_rand random(seed);
  random.discard(3);  // neighbouring seeds begin alike
  auto calls = calib::fuzz::CallsOf({reinterpret_cast<const char*>(data), size});
  const auto any = [&] {
    return calls.begin() + static_cast<std::ptrdiff_t>(random() % calls.size());
  };
  const unsigned what = calls.empty() ? 0 : random() % 10;
  if (what == 0) {
    calls.insert(calls.empty() ? calls.end() : any(),
                 Call{.method = static_cast<std::uint8_t>(random() % calib::fuzz::Methods().size()),
                      .bytes = {}});
  } else if (what == 1) {
    const Call again = *any();
    calls.insert(any(), again);
  } else if (what == 2) {
    calls.erase(any());
  } else if (what == 3) {
    std::swap(*any(), *any());
  } else {
    std::string& bytes = any()->bytes;
    const std::size_t before = bytes.size();
    bytes.resize(before + kGrowth);
    bytes.resize(
        LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(bytes.data()), before, bytes.size()));
  }
  std::string changed = calib::fuzz::BytesOf(calls);
  while (changed.size() > most && !calls.empty()) {
    calls.pop_back();
    changed = calib::fuzz::BytesOf(calls);
  }
  std::memcpy(data, changed.data(), changed.size());
  return changed.size();
}
// NOLINTEND(readability-identifier-naming)
