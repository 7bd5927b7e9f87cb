// A laboratory's table. Lines up to one that is "---" are what the experiment says of it (data,
// control, observables), the rest is the table; without such a line all of it is.
#include "tests/fuzz/campaign_checks.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

constexpr const char* kPacking =
    "      packing: {generate: {particles: 100, void_ratio: 0.68, radii: {mean: 1 mm, spread: "
    "0.2}}}\n";
constexpr const char* kPlain =
    "data: {file: table.txt}\n"
    "control: axial_strain\n"
    "observables: {stress_ratio: {noise: {relative: 0.05, floor: 0.01}}}\n";

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib::fuzz;
  const std::string input = TextOf(data, size);
  constexpr std::string_view kEnd = "\n---\n";
  const std::size_t end = input.find(kEnd);
  std::string keys = kPlain;
  std::string table = input;
  if (end != std::string::npos) {
    keys = input.substr(0, end + 1);
    table = input.substr(end + kEnd.size());
  }
  const std::string yaml = TriaxialCampaign("", kPacking + Indented(keys, 6));
  last_was_good = ReadAndCheck(yaml, {{"table.txt", table}}).problems.empty();
  return 0;
}
