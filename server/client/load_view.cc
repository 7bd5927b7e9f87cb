#include "server/client/load_view.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "proto/rpc/digest.h"
#include "server/campaign/file/campaign_file.h"
#include "server/methods/registry.h"

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
  campaign::ReadOutcome outcome =
      campaign::ReadCampaign(methods::All(), source.campaign_file(), source.file_name(), blobs,
                             seed, campaign::StoredUnder(source.reading_rules()));
  if (!outcome.problems.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("this build cannot read the campaign as it was submitted: ",
                     campaign::ToString(outcome.problems.front())));
  }
  return std::move(outcome.campaign);
}

absl::StatusOr<CampaignShelf::Read> CampaignShelf::Get(Client& client,
                                                       const v1::CampaignSource& source) {
  constexpr std::size_t kMost = 4;  // some may hold tables of many MB
  const std::string key = rpc::Sha256Hex(absl::StrCat(
      source.campaign_file(), "\n", source.has_seed() ? absl::StrCat(source.seed()) : "none", "\n",
      source.reading_rules(), "\n",
      absl::StrJoin(
          std::map<std::string, std::string>(source.files().begin(), source.files().end()), "\n",
          absl::PairFormatter("="))));
  {
    absl::MutexLock lock(&mutex_);
    for (const auto& [of, read] : last_) {
      if (of == key) return read;
    }
  }
  ASSIGN_OR_RETURN(auto campaign, LoadCampaign(client, source));
  auto read = std::make_shared<const campaign::Campaign>(std::move(campaign));
  absl::MutexLock lock(&mutex_);
  last_.emplace_front(key, read);
  if (last_.size() > kMost) last_.pop_back();
  return read;
}

absl::StatusOr<std::map<std::pair<std::string, int>, report::StateHistory>> LoadStates(
    Client& client, const std::string& campaign, std::optional<int> sample) {
  ASSIGN_OR_RETURN(const auto messages, client.GetStates(campaign, sample));
  std::map<std::pair<std::string, int>, report::StateHistory> states;
  for (const v1::SampleStates& message : messages) {
    report::StateHistory& history = states[{message.experiment(), message.sample()}];
    history.core_seconds = message.core_seconds();
    history.observables.assign(message.observables().begin(), message.observables().end());
    history.states.insert(history.states.end(), message.states().begin(), message.states().end());
  }
  return states;
}

absl::StatusOr<report::CampaignView> LoadView(Client& client, const std::string& campaign,
                                              CampaignShelf* shelf) {
  report::CampaignView view;
  ASSIGN_OR_RETURN(auto status, client.Show(campaign));
  view.status = std::move(status);
  ASSIGN_OR_RETURN(auto source, client.GetSource(campaign));
  view.source = std::move(source);
  CampaignShelf own;
  ASSIGN_OR_RETURN(const auto read, (shelf != nullptr ? *shelf : own).Get(client, view.source));
  view.campaign = *read;
  auto posterior = client.GetPosterior(campaign, std::nullopt);
  if (posterior.ok()) {
    view.posterior = *std::move(posterior);
  } else if (!absl::IsFailedPrecondition(
                 posterior.status())) {  // that one: no iteration is complete yet
    return posterior.status();
  }
  for (int k = 0; k < view.posterior.iterations(); ++k) {
    ASSIGN_OR_RETURN(auto earlier, client.GetPosterior(campaign, k));
    view.iterations.push_back(std::move(earlier));
  }
  ASSIGN_OR_RETURN(auto samples, client.GetSamples(campaign));
  view.samples = std::move(samples);
  ASSIGN_OR_RETURN(auto states, LoadStates(client, campaign, std::nullopt));
  view.states = std::move(states);
  return view;
}

}  // namespace calib::client
