#pragma once
// The design of another campaign as runs of this one's: runs know nothing of what was measured, so
// those that were made for one measurement serve every other of the same tests. Pure.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/diagnosis/design_rows.h"
#include "server/diagnosis/run_maker.h"
#include "server/diagnosis/run_matrices.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// A design and the calibrated campaign that it was made for. Both outlive it.
struct OtherDesign {
  const report::CampaignView* design = nullptr;
  const report::CampaignView* base = nullptr;
};

/// What of model, parameters or fitted tests differs between a campaign and one that a design was
/// made for, in a clause; empty: a run of the design is a run of the campaign with effects.
std::string WhyOtherRuns(const campaign::Campaign& campaign, const campaign::Campaign& design);

/// Takes the entries out of a race that the design has no parameters of.
Race RaceWithin(Race race, const report::CampaignView& design);

/// The batches of the design as runs of `rows`, after a batch of those runs of its base that `base`
/// has not (without it where there are none). all: the race of the same campaign with nobody left
/// out; runs in which an effect acts that the race of `rows` lacks are not among them. Errors:
/// FAILED_PRECONDITION with a sentence where the design has an open run, none of the main stage, or
/// a parameter that nobody knows; those of BaseRunsOf.
absl::StatusOr<std::vector<EndedBatch>> BorrowedBatches(const OtherDesign& other, const Race& all,
                                                        const DesignRows& rows,
                                                        const BaseRuns& base);

}  // namespace calib::diagnosis
