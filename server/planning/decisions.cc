#include "server/planning/decisions.h"

#include "server/planning/early_stopping.h"

namespace calib::planning {

bool DecidesWhileRunning(const Definition& definition) {
  return definition.campaign.method->chooses_while_running() || DecidesAtOnce(definition);
}

bool DecidesAtOnce(const Definition& definition) {
  return definition.campaign.decisions == campaign::Decisions::kImmediate &&
         (definition.campaign.method->chooses_while_running() || StopsEarly(definition));
}

bool RunsToItsEnds(const Definition& definition) {
  return !StopsEarly(definition) && !DecidesAtOnce(definition);
}

}  // namespace calib::planning
