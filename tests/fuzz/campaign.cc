// A campaign file, the files it may name beside it (SmallFiles).
#include "tests/fuzz/campaign_checks.h"
#include "tests/fuzz/fuzz_target.h"

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib::fuzz;
  last_was_good = ReadAndCheck(TextOf(data, size)).problems.empty();
  return 0;
}
