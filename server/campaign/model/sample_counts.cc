#include "server/campaign/model/sample_counts.h"

namespace calib::campaign {

bool SampleStatus::Add(EvaluationStatus status, bool rests) {
  if (failed_.has_value()) return false;
  ++evaluations_;
  switch (status) {
    case EvaluationStatus::kDiverged:
    case EvaluationStatus::kStoppedEarly:
    case EvaluationStatus::kFailed:
    case EvaluationStatus::kUnknown:
      failed_ = status;
      at_rung_ = status == EvaluationStatus::kStoppedEarly && rests;
      return true;
    case EvaluationStatus::kRunning:
      begun_ = true;
      break;
    case EvaluationStatus::kFinished:
      begun_ = true;
      ++finished_;
      break;
    case EvaluationStatus::kWaiting:
      break;
  }
  return false;
}

EvaluationStatus SampleStatus::worst() const {
  if (failed_.has_value()) return *failed_;
  if (evaluations_ > 0 && finished_ == evaluations_) return EvaluationStatus::kFinished;
  return begun_ ? EvaluationStatus::kRunning : EvaluationStatus::kWaiting;
}

void SampleCounts::Add(const SampleStatus& sample, int by) {
  samples += by;
  switch (sample.worst()) {
    case EvaluationStatus::kRunning:
      running += by;
      break;
    case EvaluationStatus::kFinished:
      finished += by;
      break;
    case EvaluationStatus::kDiverged:
      diverged += by;
      break;
    case EvaluationStatus::kUnknown:
      unknown += by;
      break;
    case EvaluationStatus::kStoppedEarly:
      (sample.at_rung() ? at_rung : stopped) += by;
      break;
    case EvaluationStatus::kFailed:  // it is run again once its cause is removed
    case EvaluationStatus::kWaiting:
      break;
  }
}

}  // namespace calib::campaign
