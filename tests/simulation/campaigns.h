#pragma once
// The campaigns of the simulation, small ones of every method, and the formula in place of the
// mechanics.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/worker.pb.h"
#include "server/planning/growth.h"
#include "server/store/reader.h"
#include "tests/support/small_campaign.h"

namespace calib::simulation {

struct SimulatedCampaign {
  std::string name{};
  testing::SmallCampaign files{};
  int often = 1;          ///< it is chosen so often among the others
  bool goes_on = false;   ///< what was stopped may be asked to go on: failures begin anew
  bool same_bits = true;  ///< whatever happens
  std::vector<planning::NewRuns> batches{};  ///< of a design: added one after the other
};

/// All, in a fixed order.
const std::vector<SimulatedCampaign>& Campaigns();

/// How a run ends, and after how many states; a function of what it is.
struct RunEnd {
  v1::Finished::Outcome outcome = v1::Finished::OUTCOME_COMPLETED;
  int after = 0;
  std::string reason{};
};
RunEnd EndOf(const v1::AttemptSpec& spec);

/// A smooth curve with the parameters in it; load steps from 0.
v1::State StateOf(const v1::AttemptSpec& spec, int load_step);

/// What is concluded of a campaign, with every bit; effort aside, which tells what was done twice.
absl::StatusOr<std::string> Fingerprint(store::Reader& reader, std::int64_t campaign);

}  // namespace calib::simulation
