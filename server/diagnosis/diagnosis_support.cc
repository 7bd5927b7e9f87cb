#include "server/diagnosis/diagnosis_support.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "dem/formula/user_effect.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/model/excitation.h"
#include "server/diagnosis/measurement_errors.h"

namespace calib::diagnosis {
namespace {

// That a diagnosis is content with: what eight did not show, or not clearly, sixteen showed in
// three of four cases (deploy/bench/hidden-effects.d, engine 13).
constexpr int kMorePackings = 16;

}  // namespace

absl::Status CheckDiagnosable(const FittedCampaign& base) {
  const report::CampaignView& view = base.view();
  const std::string& id = base.id();
  if (view.posterior.posterior_from().empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "no iteration of ", id, " is complete, so nothing can be said about its model"));
  }
  if (view.campaign.filter.noise != inference::NoiseMode::kGiven) {
    return absl::FailedPreconditionError(
        absl::StrCat("campaign ", id,
                     " states no size of the errors (noise is inferred or "
                     "tempered), so its model cannot be judged; give the noise"));
  }
  const std::size_t readings = base.readings().of_mean.readings.size();
  const std::size_t parameters = view.campaign.parameters.size();
  if (readings <= parameters) {
    return absl::FailedPreconditionError(
        absl::StrCat(readings, " readings cannot judge a model with ", parameters,
                     " calibrated parameters: give longer curves or more tests"));
  }
  if (base.runs().sample.empty()) {
    return absl::FailedPreconditionError(absl::StrCat("no sample of ", id, " has finished"));
  }
  return absl::OkStatus();
}

absl::Status CheckLeftOut(const std::vector<std::string>& effects,
                          const campaign::Campaign& campaign) {
  for (const std::string& name : effects) {
    if (dem::FindEffect(campaign.model.user_effects, name) == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat("there is no effect ", name, " to leave out; see `calibctl effects`"));
    }
  }
  return absl::OkStatus();
}

bool HasFewReadings(const FittedCampaign& base) {
  constexpr std::size_t kPerParameter = 5;
  return base.readings().of_mean.readings.size() <
         kPerParameter * (base.view().campaign.parameters.size() + 1);
}

std::vector<std::string> DoubtsOf(const FittedCampaign& base) {
  std::vector<std::string> doubts;
  const report::CampaignView& view = base.view();
  if (HasFewReadings(base)) {
    const std::size_t readings = base.readings().of_mean.readings.size();
    const std::size_t parameters = view.campaign.parameters.size();
    doubts.push_back(absl::StrCat("Only ", readings, " readings are fitted with ", parameters,
                                  parameters == 1 ? " parameter" : " parameters",
                                  ": little can be seen with so few, neither a missing effect nor "
                                  "that there is none. Give longer curves or more tests."));
  }
  const auto& experiments = view.campaign.experiments;
  const bool one_packing =
      std::all_of(experiments.begin(), experiments.end(), [](const campaign::Experiment& e) {
        return e.role != campaign::Role::kCalibrate || e.specimens.size() <= 1;
      });
  const bool has_grains =
      std::none_of(experiments.begin(), experiments.end(), &campaign::MakesItsBodies);
  if (one_packing && has_grains && !view.campaign.precomputed) {
    doubts.push_back(absl::StrCat(
        "Every fitted test is run on one packing: by how much another one differs is not in the "
        "errors, and may be taken for a missing effect unless the packing is the measured one. "
        "realizations: ",
        kMorePackings, " or more show it."));
  }
  return doubts;
}

std::string FewPackings(const inference::FittedModel& model, int measured) {
  if (measured < 2) return "";
  if (measured < kFewestPackings) {
    return absl::StrCat("The scatter between packings is known from ", measured,
                        " of them, and any misfit may be more of it: with fewer than ",
                        kFewestPackings,
                        " nothing is called missing (`realizations: ", kMorePackings,
                        "` or more lets smaller effects be seen).");
  }
  if (model.without.empty()) {
    return absl::StrCat("Of the packings of all experiments together fewer than ", kFewestPackings,
                        " can be told apart, so that a misfit must be very large to count: give "
                        "every experiment the same `realizations`, ",
                        kMorePackings, " or more.");
  }
  if (measured < kMorePackings) {
    return absl::StrCat("The scatter between packings is known from ", measured,
                        " of them, so that a misfit must be large to count: `realizations: ",
                        kMorePackings, "` or more lets smaller effects be seen.");
  }
  return "";
}

}  // namespace calib::diagnosis
