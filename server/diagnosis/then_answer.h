#pragma once
// The answer once a proposed measurement has been made: both measurements together.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/answer.h"
#include "server/diagnosis/design_stages.h"
#include "server/diagnosis/test_plans.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// A proposal, and the file that was measured: columns as its snippet says.
struct MadeMeasurement {
  PlannedExperiment plan{};
  std::string file{}, content{};  ///< name as people know it, and text
};

struct ThenAnswer {
  Answer answer{};
  std::string campaign{};        ///< that holds the runs of the test; empty: none were needed
  std::int64_t evaluations = 0;  ///< in it
  std::vector<std::string> warnings{};
};

/// The models that led before compete for both measurements, the new one on a specimen of its own.
/// A repeat at the very values of the control is told by the design's runs; any other takes runs of
/// its own (RowsOfTest). What would be named is verified by fresh runs of the test.
/// Errors: INVALID_ARGUMENT where the file cannot be read, or is not the proposed test: the control
/// turns as often and comes, at each end, within a fiftieth of its range to what was planned; those
/// of the runs.
absl::StatusOr<ThenAnswer> AnswerWith(client::Laboratory& laboratory,
                                      const report::CampaignView& base,
                                      const AnsweredDesign& answered, const MadeMeasurement& made);

}  // namespace calib::diagnosis
