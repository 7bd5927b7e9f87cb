#include "server/diagnosis/diagnosis_support.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "dem/formula/user_effect.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/model/excitation.h"
#include "server/report/views/run_table.h"

namespace calib::diagnosis {
namespace {

// With so many the law of a misfit is close to what it is where the scatter is known: Student's
// with 15 degrees of freedom has 1.15 times the variance of a normal one.
constexpr int kMorePackings = 16;
// With fewer the law of a misfit has no variance (Student's with two degrees of freedom).
constexpr int kFewestApart = 4;

}  // namespace

absl::Status CheckDiagnosable(const report::CampaignView& view) {
  const std::string& id = view.status.campaign();
  if (view.posterior.posterior_from().empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "no iteration of ", id, " is complete, so nothing can be said about its model"));
  }
  if (view.campaign.filter.noise != inference::NoiseMode::kGiven) {
    return absl::FailedPreconditionError(
        absl::StrCat("campaign ", id,
                     " states no size of the errors (noise is inferred, beside a model error or "
                     "tempered), so its model cannot be judged; give the noise"));
  }
  const std::size_t readings = campaign::MakeDataSet(view.campaign).readings.size();
  const std::size_t parameters = view.campaign.parameters.size();
  if (readings <= parameters) {
    return absl::FailedPreconditionError(
        absl::StrCat(readings, " readings cannot judge a model with ", parameters,
                     " calibrated parameters: give longer curves or more tests"));
  }
  if (report::RunsOf(view).sample.empty()) {
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

bool HasFewReadings(const campaign::Campaign& campaign) {
  constexpr std::size_t kPerParameter = 5;
  return campaign::MakeDataSet(campaign).readings.size() <
         kPerParameter * (campaign.parameters.size() + 1);
}

std::vector<std::string> DoubtsOf(const campaign::Campaign& campaign) {
  std::vector<std::string> doubts;
  if (HasFewReadings(campaign)) {
    const std::size_t readings = campaign::MakeDataSet(campaign).readings.size();
    const std::size_t parameters = campaign.parameters.size();
    doubts.push_back(absl::StrCat("Only ", readings, " readings are fitted with ", parameters,
                                  parameters == 1 ? " parameter" : " parameters",
                                  ": little can be seen with so few, neither a missing effect nor "
                                  "that there is none. Give longer curves or more tests."));
  }
  const auto& experiments = campaign.experiments;
  const bool one_packing =
      std::all_of(experiments.begin(), experiments.end(), [](const campaign::Experiment& e) {
        return e.role != campaign::Role::kCalibrate || e.specimens.size() <= 1;
      });
  const bool has_grains =
      std::none_of(experiments.begin(), experiments.end(), &campaign::MakesItsBodies);
  const bool of_a_test = std::any_of(experiments.begin(), experiments.end(),
                                     [](const auto& e) { return !e.test.empty(); });
  if (campaign.program) {
    if (one_packing && of_a_test) {
      doubts.push_back(
          "Every fitted test is run in one realization: by how much another specimen differs is "
          "not in the errors, and may be taken for a missing effect unless the specimen is the "
          "measured one. realizations: {packing: [...]}, or a number of seeds, shows it.");
    }
  } else if (one_packing && has_grains && !campaign.precomputed) {
    doubts.push_back(absl::StrCat(
        "Every fitted test is run on one packing: by how much another one differs is not in the "
        "errors, and may be taken for a missing effect unless the packing is the measured one. "
        "realizations: ",
        kMorePackings, " or more show it."));
  }
  return doubts;
}

std::string FewPackings(int measured, int apart) {
  if (measured < 2) return "";
  if (measured < kFewestApart) {
    return absl::StrCat("The scatter between packings is known from ", measured,
                        " of them, which is next to nothing: any misfit may be more of it "
                        "(`realizations: ",
                        kMorePackings, "` or more lets effects be seen).");
  }
  if (apart < kFewestApart) {
    return absl::StrCat("Of the packings of all experiments together ", apart,
                        " can be told apart, so that a misfit must be very large to count: give "
                        "every experiment the same `realizations`, ",
                        kMorePackings, " or more.");
  }
  if (measured >= kMorePackings) return "";
  return absl::StrCat("The scatter between packings is known from ", measured,
                      " of them, so that a misfit must be large to count: `realizations: ",
                      kMorePackings, "` or more lets smaller effects be seen.");
}

}  // namespace calib::diagnosis
