#pragma once
// The calibration of a model with more effects, begun where a diagnosis has seen it fit: few runs
// at a time, added to those that were made until its posterior stands still.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/campaign/file/derive.h"
#include "server/diagnosis/answer.h"
#include "server/diagnosis/extension.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// Of the fitted data, as in report::Comparison.
double ErrorOf(const report::CampaignView& view);

/// Runs of a design that are runs of the extended model: to their ends, with these effects and no
/// others, the numerics as they are, inside the priors that the extension would have. Each
/// with all its parameters; found again by their digests, they cost nothing.
std::vector<campaign::Derivation::Row> RunsOfModel(const report::CampaignView& parent,
                                                   const report::CampaignView& design,
                                                   const std::vector<std::string>& effects);

/// What steers a calibration that a diagnosis has asked for.
struct ExtendedOptions {
  /// Of the diagnosis that saw the model fit, or null; outlives the plan's making.
  const report::CampaignView* design = nullptr;
  int times = 1;  ///< as often as few iterations at most; those of fewer are found again
  /// Model evaluations of the fitted tests; none: as many as it takes.
  std::optional<std::int64_t> budget{};
};

/// Up to which ExtendedOptions::times a calibration is worth its runs: 25 samples for each
/// parameter by then, for three what a diagnosis of 125 runs leaves of 220 in all, replicates among
/// them.
inline constexpr int kMostTimes = 2;

/// How a model is calibrated with effects on top whose posterior is known about. Of a filter, five
/// samples for each parameter at draws of that posterior, twice as far from its mean, and five from
/// a proposal about it: together the ten that an emulator takes; then five from what is known by
/// then; beside them the runs of the design. Of other methods: as the parent; of tables of runs
/// what they hold.
///                                     [Loeppky, Sacks & Welch, Technometrics 51 (2009) 366]
/// Errors: RESOURCE_EXHAUSTED where the budget allows no iteration.
absl::StatusOr<ExtensionPlan> PlanExtended(const report::CampaignView& parent,
                                           const NamedModel& model,
                                           const ExtendedOptions& options = {});

/// Whether further iterations are not needed: there are none, or the posterior is known and comes
/// as close as the diagnosis has seen.
bool IsFound(const report::CampaignView& extended, const NamedModel& model);

}  // namespace calib::diagnosis
