// A packing file; one that can be read is then the specimen of a campaign.
#include "dem/particles/packing.h"

#include <cmath>

#include "tests/fuzz/campaign_checks.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

constexpr const char* kExperiment = R"(      packing: {file: packing.txt}
      realizations: 2
      data: {file: validation.csv, strain: logarithmic}
      control: axial_strain
      observables: {q_over_p: {noise: {relative: 0.05}}}
)";

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib;
  std::vector<dem::PackingProblem> problems;
  const dem::Packing packing = dem::ParsePacking(fuzz::TextOf(data, size), problems);
  for (const dem::PackingProblem& problem : problems) {
    fuzz::Expect(!problem.message.empty() && problem.line >= 0, "a problem says what and where");
  }
  fuzz::last_was_good = problems.empty();
  if (!problems.empty()) {
    return 0;
  }
  const std::size_t n = packing.radius.size();
  fuzz::Expect(n >= 2 && packing.x.size() == n && packing.y.size() == n && packing.z.size() == n &&
                   packing.clump.size() == n &&
                   (packing.material.empty() || packing.material.size() == n),
               "every grain has a place, a radius, a clump");
  for (std::size_t i = 0; i < n; ++i) {
    fuzz::Expect(std::isfinite(packing.x[i]) && std::isfinite(packing.y[i]) &&
                     std::isfinite(packing.z[i]) && std::isfinite(packing.radius[i]) &&
                     packing.radius[i] > 0,
                 "places are finite and radii above 0");
  }
  fuzz::Expect(std::isfinite(dem::PorosityOf(packing)), "there is a porosity");
  const std::string text = dem::FormatPacking(packing);
  const dem::Packing again = dem::ParsePacking(text, problems);
  fuzz::Expect(problems.empty() && dem::FormatPacking(again) == text && again.x == packing.x &&
                   again.radius == packing.radius && again.clump == packing.clump,
               "a packing that is written is read with the same bits");
  fuzz::ReadAndCheck(fuzz::TriaxialCampaign("", kExperiment), {{"packing.txt", text}});
  return 0;
}
