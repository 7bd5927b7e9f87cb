// What stands under model.user_effects: names, formulas, units, nulls.
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tests/fuzz/campaign_checks.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

constexpr const char* kModel = R"(name: effects
model:
  contact: hertz_mindlin
  density: 2650 kg/m^3
  fixed: {poisson_ratio: 0.2}
  user_effects:
)";
constexpr const char* kRest = R"(parameters:
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}
  friction_angle: {prior: uniform, min: 10 deg, max: 45 deg}
inference: {method: iterative_bayesian_filter, samples: 20, max_iterations: 3}
experiments:
  - name: tx
    test: triaxial_drained
    confining_pressure: 0.2 MPa
    packing: {generate: {particles: 100, void_ratio: 0.68, radii: {mean: 1 mm, spread: 0.2}}}
    data: {file: validation.csv, strain: logarithmic}
    control: axial_strain
    observables: {q_over_p: {noise: {relative: 0.05}}}
)";

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib::fuzz;
  std::string yaml = kModel;
  const std::string input = TextOf(data, size);
  for (const auto line : absl::StrSplit(input, '\n')) absl::StrAppend(&yaml, "    ", line, "\n");
  last_was_good = ReadAndCheck(yaml + kRest).problems.empty();
  return 0;
}
