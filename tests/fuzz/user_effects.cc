// What stands under model.user_effects: names, formulas, units, nulls.
#include "tests/fuzz/campaign_checks.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

constexpr const char* kExperiment =
    R"(      packing: {generate: {particles: 100, void_ratio: 0.68, radii: {mean: 1 mm, spread: 0.2}}}
      data: {file: validation.csv, strain: logarithmic}
      control: axial_strain
      observables: {q_over_p: {noise: {relative: 0.05}}}
)";

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib::fuzz;
  const std::string effects = "    user_effects:\n" + Indented(TextOf(data, size), 6);
  last_was_good = ReadAndCheck(TriaxialCampaign(effects, kExperiment)).problems.empty();
  return 0;
}
