#pragma once
// The words of messages as what they stand for. Each is empty for a word that this build does not
// know, and for none.

#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "calib/v1/campaign.pb.h"
#include "server/campaign/model/words.h"

namespace calib::messages {

inline std::optional<campaign::CampaignState> StateOf(const v1::CampaignStatus& status) {
  return campaign::ToCampaignState(status.state());
}
/// True in the states in which nothing happens any more to a campaign.
inline bool IsOver(const v1::CampaignStatus& status) {
  const auto state = StateOf(status);
  return state && campaign::IsOver(*state);
}
inline std::optional<campaign::Phase> PhaseOf(const v1::CampaignStatus& status) {
  return campaign::ValueOf(campaign::kPhaseWords, status.phase());
}
/// What is said of a campaign that infers nothing to who asks for what it has found.
inline std::string InfersNothing(const std::string& campaign, const std::string& method) {
  return absl::StrCat("campaign ", campaign, " runs the rows of its ", method,
                      " and infers nothing: see samples, states and export");
}
inline std::optional<campaign::DerivedFor> PurposeOf(const v1::CampaignStatus& status) {
  return campaign::ToDerivedFor(status.purpose());
}

inline std::optional<campaign::EvaluationStatus> StatusOf(const v1::Sample& sample) {
  return campaign::ValueOf(campaign::kEvaluationStatusWords, sample.status());
}
inline std::optional<campaign::SamplePurpose> PurposeOf(const v1::Sample& sample) {
  return campaign::ValueOf(campaign::kSamplePurposeWords, sample.purpose());
}

inline std::optional<campaign::PosteriorSource> SourceOf(const v1::Posterior& posterior) {
  return campaign::ValueOf(campaign::kPosteriorSourceWords, posterior.posterior_from());
}
inline std::optional<campaign::ScatterSource> SourceOf(const v1::Posterior::Scatter& scatter) {
  return campaign::ValueOf(campaign::kScatterSourceWords, scatter.from());
}

}  // namespace calib::messages
