#include "server/diagnosis/extended_calibration.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/diagnosis/extension.h"
#include "server/report/views/comparison.h"

namespace calib::diagnosis {
namespace {

// No calibration takes more: all iterations, replicates and held-out draws.
std::int64_t MostEvaluations(const campaign::Campaign& campaign, int times) {
  constexpr std::int64_t kReplicatesAndDraws = 100;
  const auto samples = static_cast<std::int64_t>(campaign.samples) * campaign.max_iterations;
  return (samples * times + kReplicatesAndDraws) *
         static_cast<std::int64_t>(campaign.experiments.size());
}

// Whether more samples are not needed: the posterior is known, and as close as it should be.
bool IsFound(const report::CampaignView& view, const NamedModel& model) {
  // Over a posterior, of noise sd: where the emulator knows less, the mean may lie anywhere
  // (inference/emulator/README.md).
  constexpr double kKnown = 0.3;
  // A right model at its posterior misses readings by their errors.
  constexpr double kRight = 1;
  if (view.posterior.posterior_from() == "none") return false;
  const double unknown =
      view.posterior.posterior_from() == "emulator" ? view.posterior.emulator().unknown() : 0;
  return unknown <= kKnown && ErrorOf(view) <= std::max(model.rms, kRight);
}

bool IsCloser(const report::CampaignView& a, const report::CampaignView& b) {
  const bool has_posterior = a.posterior.posterior_from() != "none";
  if (has_posterior != (b.posterior.posterior_from() != "none")) return has_posterior;
  return ErrorOf(a) < ErrorOf(b);
}

}  // namespace

double ErrorOf(const report::CampaignView& view) {
  return report::Compare(view, report::PredictReadings(view)).rms_error;
}

absl::StatusOr<report::CampaignView> ExtendedCalibration::Of(const report::CampaignView& parent,
                                                             const NamedModel& model) {
  absl::StatusOr<report::CampaignView> best = Once(parent, model, 1);
  for (int times = 2; best.ok() && times <= times_ && !IsFound(*best, model); ++times) {
    auto again = Once(parent, model, times);
    if (absl::IsResourceExhausted(again.status())) break;
    if (!again.ok()) return again;
    if (IsCloser(*again, *best)) best = std::move(again);
  }
  return best;
}

absl::StatusOr<report::CampaignView> ExtendedCalibration::Once(const report::CampaignView& parent,
                                                               const NamedModel& model, int times) {
  const campaign::Campaign& campaign = parent.campaign;
  // One iteration, whatever is asked for: as much again is as many samples.
  const bool by_samples = campaign.method == campaign::Method::kSqmc;
  const int samples = campaign.samples * (by_samples ? times : 1);
  const auto fitted =
      std::count_if(campaign.experiments.begin(), campaign.experiments.end(),
                    [](const auto& e) { return e.role == campaign::Role::kCalibrate; });
  const std::int64_t least = static_cast<std::int64_t>(samples) * fitted;
  std::optional<std::int64_t> budget;
  if (budget_) budget = std::max<std::int64_t>(0, *budget_ - evaluations_);
  if (budget && *budget < least) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "an iteration takes ", least, " model evaluations, and ", *budget, " are left"));
  }
  const std::optional<std::int64_t>& own = campaign.budget.model_evaluations;
  if (budget && own) {
    budget = std::min(*budget, *own);
  } else if (budget && *budget >= MostEvaluations(campaign, times)) {
    budget.reset();
  }
  ExtensionPlan plan{.effects = model.effects,
                     .purpose = "extension",
                     .near = model.posterior,
                     .samples = std::nullopt,
                     .iterations = std::nullopt,
                     .model_evaluations = budget};
  if (times > 1 && by_samples) plan.samples = samples;
  if (times > 1 && !by_samples) plan.iterations = times * campaign.max_iterations;
  ASSIGN_OR_RETURN(const auto text, ExtensionText(parent, plan));
  auto extended =
      laboratory_.Run(parent, text, "calibration with " + absl::StrJoin(model.effects, " + "));
  if (extended.ok()) evaluations_ += extended->status.model_evaluations();
  return extended;
}

}  // namespace calib::diagnosis
