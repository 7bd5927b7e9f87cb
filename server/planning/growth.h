#pragma once
// Runs that are added to a design once all it had have ended: a batch, which is an iteration of the
// store. The batch itself is what it is known by: added again it is there.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/planning/definition.h"
#include "server/planning/plan.h"
#include "server/store/reader.h"

namespace calib::planning {

struct NewRuns {
  std::int64_t campaign = 0;
  int iteration = 0;  ///< number of the batch, from 0: as many as there are
  campaign::SamplePurpose stage = campaign::SamplePurpose::kMain;  ///< campaign::IsStageOfDesign()
  std::vector<std::string> experiments{};  ///< that they are run through; none: all that are fitted
  std::vector<campaign::RunOf> rows{};     ///< 1 to campaign::kMostRowsOfBatch
};

struct Growth {
  bool is_there = false;               ///< with this content: nothing is to be written
  Plan plan{};                         ///< otherwise
  store::CampaignProgress progress{};  ///< after it
};

/// What it takes to add them, from the store alone. NOT_FOUND: no such campaign. INVALID_ARGUMENT:
/// it is no design, has no such experiment, or cannot run a row (campaign::WhyNotRun).
/// ALREADY_EXISTS: a batch of this number is there with another content. FAILED_PRECONDITION: its
/// runs have not ended, it is over otherwise than finished, or the number is beyond the next. Each
/// a sentence.
absl::StatusOr<Growth> PlanGrowth(const campaign::MethodList& methods, store::Reader& reader,
                                  const NewRuns& runs);

/// What the samples of a stored iteration were added for; kEnsemble: it is no batch of a design.
campaign::SamplePurpose StageIn(const std::string& proposal);

}  // namespace calib::planning
