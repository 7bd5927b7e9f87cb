#include "server/client/load_view.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/campaign_file.h"

namespace calib::client {

absl::StatusOr<campaign::Campaign> LoadCampaign(Client& client, const v1::CampaignSource& source) {
  const campaign::FileReader blobs =
      [&client, &source](const std::string& path) -> absl::StatusOr<std::string> {
    const auto digest = source.files().find(path);
    if (digest == source.files().end()) return absl::NotFoundError("was not submitted");
    return client.GetBlob(digest->second);
  };
  std::optional<std::uint64_t> seed;
  if (source.has_seed()) seed = source.seed();
  campaign::ReadOutcome outcome = campaign::ReadCampaign(
      source.campaign_file(), source.file_name(), blobs, seed, campaign::CampaignIs::kStored);
  if (!outcome.problems.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("this build cannot read the campaign as it was submitted: ",
                     campaign::ToString(outcome.problems.front())));
  }
  return std::move(outcome.campaign);
}

absl::StatusOr<std::map<std::pair<std::string, int>, report::StateHistory>> LoadStates(
    Client& client, const std::string& campaign, std::optional<int> sample) {
  const auto messages = client.GetStates(campaign, sample);
  if (!messages.ok()) return messages.status();
  std::map<std::pair<std::string, int>, report::StateHistory> states;
  for (const v1::SampleStates& message : *messages) {
    report::StateHistory& history = states[{message.experiment(), message.sample()}];
    history.core_seconds = message.core_seconds();
    history.observables.assign(message.observables().begin(), message.observables().end());
    history.states.insert(history.states.end(), message.states().begin(), message.states().end());
  }
  return states;
}

absl::StatusOr<report::CampaignView> LoadView(Client& client, const std::string& campaign) {
  report::CampaignView view;
  auto status = client.Show(campaign);
  if (!status.ok()) return status.status();
  view.status = *std::move(status);
  auto source = client.GetSource(campaign);
  if (!source.ok()) return source.status();
  view.source = *std::move(source);
  auto read = LoadCampaign(client, view.source);
  if (!read.ok()) return read.status();
  view.campaign = *std::move(read);
  auto posterior = client.GetPosterior(campaign, std::nullopt);
  if (posterior.ok()) {
    view.posterior = *std::move(posterior);
  } else if (!absl::IsFailedPrecondition(
                 posterior.status())) {  // that one: no iteration is complete yet
    return posterior.status();
  }
  for (int k = 0; k < view.posterior.iterations(); ++k) {
    auto earlier = client.GetPosterior(campaign, k);
    if (!earlier.ok()) return earlier.status();
    view.iterations.push_back(*std::move(earlier));
  }
  auto samples = client.GetSamples(campaign);
  if (!samples.ok()) return samples.status();
  view.samples = *std::move(samples);
  auto states = LoadStates(client, campaign, std::nullopt);
  if (!states.ok()) return states.status();
  view.states = *std::move(states);
  return view;
}

}  // namespace calib::client
