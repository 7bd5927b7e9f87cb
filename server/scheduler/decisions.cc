#include "server/scheduler/decisions.h"

#include "server/scheduler/early_stopping.h"

namespace calib::scheduler {

bool DecidesWhileRunning(const Definition& definition) {
  return definition.campaign.method == campaign::Method::kSurrogateMsrs ||
         DecidesAtOnce(definition);
}

bool DecidesAtOnce(const Definition& definition) {
  return definition.campaign.decisions == campaign::Decisions::kImmediate &&
         (definition.campaign.method == campaign::Method::kSurrogateMsrs || StopsEarly(definition));
}

bool RunsToItsEnds(const Definition& definition) {
  return !StopsEarly(definition) && !DecidesAtOnce(definition);
}

}  // namespace calib::scheduler
