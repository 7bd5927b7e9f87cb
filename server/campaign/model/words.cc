#include "server/campaign/model/words.h"

namespace calib::campaign {

const char* ToString(CampaignState state) { return WordOf(kCampaignStateWords, state); }

std::optional<CampaignState> ToCampaignState(std::string_view word) {
  return ValueOf(kCampaignStateWords, word);
}

bool IsOver(CampaignState state) {
  return state == CampaignState::kFinished || state == CampaignState::kFailed ||
         state == CampaignState::kCancelled;
}

const char* ToString(Phase phase) { return WordOf(kPhaseWords, phase); }

const char* ToString(EvaluationStatus status) { return WordOf(kEvaluationStatusWords, status); }

bool IsTerminal(EvaluationStatus status) {
  return status == EvaluationStatus::kFinished || status == EvaluationStatus::kDiverged ||
         status == EvaluationStatus::kStoppedEarly || status == EvaluationStatus::kUnknown;
}

const char* ToString(SamplePurpose purpose) { return WordOf(kSamplePurposeWords, purpose); }

bool IsStageOfDesign(SamplePurpose purpose) {
  return purpose != SamplePurpose::kEnsemble && purpose != SamplePurpose::kReplicate &&
         purpose != SamplePurpose::kDraw;
}

const char* ToString(DerivedFor purpose) { return WordOf(kDerivedForWords, purpose); }

std::optional<DerivedFor> ToDerivedFor(std::string_view word) {
  return ValueOf(kDerivedForWords, word);
}

const char* ToString(PosteriorSource source) { return WordOf(kPosteriorSourceWords, source); }

}  // namespace calib::campaign
