#include "server/campaign/model/replicates.h"

#include <algorithm>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/model/excitation.h"

namespace calib::campaign {
namespace {

constexpr std::size_t kMostPackings = 16;
constexpr int kTwins = 8;

}  // namespace

bool VariesPackings(const Campaign& campaign) {
  return std::any_of(campaign.experiments.begin(), campaign.experiments.end(),
                     [](const Experiment& e) { return e.specimens.size() > 1; });
}

bool HasOnePacking(const Experiment& experiment) {
  const dem::TestInfo* const test = dem::FindTest(experiment.test);
  return experiment.specimens.size() == 1 && !MakesItsBodies(experiment) && test != nullptr &&
         !test->poured;
}

int ReplicatesOf(const Campaign& campaign) {
  if (campaign.precomputed || RunsRowsOnly(campaign) ||
      campaign.filter.noise == inference::NoiseMode::kEssTarget) {
    return 0;
  }
  int wanted = 0;
  if (VariesPackings(campaign)) {
    std::size_t most = 0;
    for (const Experiment& experiment : campaign.experiments) {
      most = std::max(most, experiment.specimens.size());
    }
    wanted = static_cast<int>(std::min(most, kMostPackings));
  } else if (std::any_of(campaign.experiments.begin(), campaign.experiments.end(),
                         [](const Experiment& e) {
                           return e.role == Role::kCalibrate && HasOnePacking(e);
                         })) {
    wanted = kTwins;
  }
  return std::min(campaign.replicates.value_or(wanted), campaign.samples);
}

std::string TwinsInWords(const Campaign& campaign) {
  const int twins = ReplicatesOf(campaign);
  if (twins < 2 || VariesPackings(campaign)) return "";
  const auto tests = static_cast<int>(campaign.experiments.size());
  return absl::StrCat("After the calibration the best estimate is run ", twins,
                      " times with parameters that differ by a millionth, ", twins * tests,
                      tests == 1 ? " model evaluations" : " model evaluations in all tests",
                      ": what these twins differ by is chance of one specimen and joins the "
                      "errors (inference.replicates; 0: none).");
}

}  // namespace calib::campaign
