#include "server/planning/phases/step.h"

namespace calib::planning {

void Step::Finish() {
  plan.phase = campaign::Phase::kDone;
  plan.event = CampaignEvent::kFinish;
}

absl::Status Step::Fail(const absl::Status& why) {
  plan = Plan{};
  plan.phase = record.progress.phase;
  plan.event = CampaignEvent::kFail;
  plan.reason = std::string(why.message());
  return absl::OkStatus();
}

}  // namespace calib::planning
