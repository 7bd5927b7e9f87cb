#pragma once
// Readings that no parameters of the prior reach: a conflict of prior and data, which no fit can
// mend. Known as soon as the first iteration is complete.

#include <string>
#include <vector>

#include "server/report/views/campaign_view.h"

namespace calib::report {

/// A stretch of neighbouring readings on one side of all runs.
struct PriorConflict {
  std::string experiment, observable, control_name;
  double from = 0, to = 0;  ///< control at its first and last reading [SI]
  int readings = 0;
  bool too_low = false;  ///< all runs lie below the readings; otherwise above
  double nearest = 0;    ///< distance of the run that comes nearest at the worst reading, in sd of
                         ///< one run and a measurement: noise and scatter
};

/// The runs of the first iteration; of a campaign that begins near another's posterior half of them
/// are of its prior. A reading counts that lies beyond all runs by more than three of its standard
/// deviations and a tenth of their range (runs do not reach the corners of the prior), in stretches
/// of at least two. Calibrated experiments only; none with fewer than `kLeastRuns` finished runs or
/// without a known size of the errors.
std::vector<PriorConflict> PriorConflicts(const CampaignView& view);

/// Finished runs from the prior below which nothing is said of a conflict: an extreme of fewer is
/// chance.
inline constexpr int kLeastRuns = 20;

/// One sentence.
std::string InWords(const PriorConflict& conflict);

}  // namespace calib::report
