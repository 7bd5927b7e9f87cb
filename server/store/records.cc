#include "server/store/records.h"

namespace calib::store {

const char* ToString(EvaluationStatus status) {
  switch (status) {
    case EvaluationStatus::kWaiting:
      return "waiting";
    case EvaluationStatus::kRunning:
      return "running";
    case EvaluationStatus::kFinished:
      return "finished";
    case EvaluationStatus::kDiverged:
      return "diverged";
    case EvaluationStatus::kStoppedEarly:
      return "stopped_early";
    case EvaluationStatus::kFailed:
      break;
  }
  return "failed";
}

bool IsTerminal(EvaluationStatus status) {
  return status == EvaluationStatus::kFinished || status == EvaluationStatus::kDiverged ||
         status == EvaluationStatus::kStoppedEarly;
}

}  // namespace calib::store
