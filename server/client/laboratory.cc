#include "server/client/laboratory.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/model/identity.h"
#include "server/campaign/model/sha256.h"
#include "server/client/interrupt.h"
#include "server/client/load_view.h"
#include "server/client/progress.h"
#include "server/client/standstill_notice.h"
#include "server/messages/read_words.h"
#include "server/methods/registry.h"

namespace calib::client {

using campaign::CampaignState;

namespace {

constexpr std::chrono::milliseconds kPollServer{100};
constexpr std::chrono::milliseconds kPollDisk{1000};

// About a campaign that is not finished.
std::string WhatToDo(const v1::CampaignStatus& status) {
  const std::string& id = status.campaign();
  const auto state = messages::StateOf(status);
  if (state == CampaignState::kPaused) return absl::StrCat("go on with `calibctl resume ", id, "`");
  if (state == CampaignState::kFailed) {
    return "its reason says what to change in the campaign file before it is submitted again";
  }
  if (state == CampaignState::kCancelled)
    return "submit it again (with another seed) and let it end";
  return absl::StrCat("wait for it with `calibctl watch ", id, "`");
}

// Runs that another verb made for a purpose of its own say nothing by themselves, and rows never.
std::string WhyNoCalibration(const v1::CampaignStatus& status) {
  const bool rows_only = status.infers_nothing();
  if (rows_only && status.parent().empty()) {
    return messages::InfersNothing(status.campaign(), status.method());
  }
  const bool trial = rows_only || messages::PurposeOf(status) == campaign::DerivedFor::kWarmFit;
  if (!trial || status.parent().empty()) return "";
  return absl::StrCat(status.campaign(), " is no calibration but a trial (", status.purpose(),
                      ") made of ", status.parent(), "; ask ", status.parent(), " instead");
}

const absl::Status& StatusIn(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusIn(const absl::StatusOr<T>& answer) {
  return answer.status();
}

/// What `change` returns, asked again for as long as the server waits for room on its disk.
/// campaign: any that it knows.
template <typename Change>
auto OnceThereIsRoom(Session& session, const std::string& campaign, const Change& change)
    -> decltype(change()) {
  StandstillNotice notice(session);
  for (bool waited = true;;) {
    auto outcome = change();
    if (!absl::IsResourceExhausted(StatusIn(outcome)) || !waited || Interrupted()) return outcome;
    const auto status = session.client().Show(campaign);
    if (!status.ok()) return outcome;
    notice.LookAtServer(*status);
    waited = !status->server_waits().empty();  // else there may be room since: once more
    if (waited) std::this_thread::sleep_for(kPollDisk);
  }
}

/// What the server has no room for, told from the budget of a question that is spent, which is
/// RESOURCE_EXHAUSTED to who asks.
absl::Status ServersLimit(const absl::Status& status) {
  return absl::IsResourceExhausted(status) ? absl::OutOfRangeError(std::string(status.message()))
                                           : status;
}

}  // namespace

absl::StatusOr<report::CampaignView> Laboratory::Finished(const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto status, session_.client().Show(campaign));
  if (messages::StateOf(status) != CampaignState::kFinished) {
    return absl::FailedPreconditionError(absl::StrCat(
        "campaign ", campaign, " is ", status.state(), ", not finished",
        status.reason().empty() ? "" : ": " + status.reason(), "; ", WhatToDo(status)));
  }
  if (const std::string why = WhyNoCalibration(status); !why.empty()) {
    return absl::FailedPreconditionError(why);
  }
  return LoadView(session_.client(), campaign);
}

absl::StatusOr<Laboratory::DesignWithBase> Laboratory::DesignNamed(const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto status, session_.client().Show(campaign));
  if (messages::PurposeOf(status) != campaign::DerivedFor::kDesign || status.parent().empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(campaign,
                     " is no design: the JSON of diagnose names the campaign of its runs in "
                     "`design.campaign`"));
  }
  DesignWithBase result;
  ASSIGN_OR_RETURN(result.design, LoadView(session_.client(), campaign));
  ASSIGN_OR_RETURN(result.base, Finished(status.parent()));
  return result;
}

absl::Status Laboratory::Wait(const std::string& campaign, const std::string& what) {
  std::optional<ProgressLine> line;  // nothing is said of what is done already
  StandstillNotice notice(session_);
  for (;;) {
    const auto status = session_.client().Show(campaign);
    if (!status.ok()) {
      const absl::Status why = session_.Check();
      return why.ok() ? status.status() : why;
    }
    const auto state = messages::StateOf(*status);
    if (!line && state == CampaignState::kFinished) return absl::OkStatus();
    if (!line) {
      std::cerr << what << ": campaign " << campaign << "\n";
      line.emplace();
    }
    constexpr int kMilestones = 5;
    line->Show(ProgressText(*status),
               kMilestones * 2 * status->iteration() +
                   kMilestones * status->samples_done() / std::max(1, status->samples()));
    if (state == CampaignState::kFinished) return absl::OkStatus();
    notice.Look(*status);
    if (messages::IsOver(*status) || state == CampaignState::kPaused) {
      const std::string why =
          absl::StrCat("campaign ", campaign, " (", what, ") is ", status->state(),
                       status->reason().empty() ? "" : ": ", status->reason());
      return state == CampaignState::kFailed ? absl::AbortedError(why)
                                             : absl::FailedPreconditionError(why);
    }
    if (Interrupted()) {
      return absl::CancelledError("stopped; nothing is lost, the same command goes on from here");
    }
    RETURN_IF_ERROR(session_.Check());
    std::this_thread::sleep_for(kPollServer);
  }
}

absl::StatusOr<std::string> Laboratory::Submit(const report::CampaignView& parent,
                                               const std::string& yaml, const std::string& what,
                                               const std::map<std::string, std::string>& further) {
  v1::SubmitRequest request;
  request.set_campaign_file(yaml);
  request.set_file_name(parent.source.file_name());
  if (parent.source.has_seed()) request.set_seed(parent.source.seed());
  *request.mutable_files() = parent.source.files();
  for (const auto& file : further) {
    const std::string& content = file.second;
    RETURN_IF_ERROR(ServersLimit(OnceThereIsRoom(
        session_, parent.status.campaign(), [&] { return session_.client().PutBlob(content); })));
    (*request.mutable_files())[file.first] = campaign::Sha256Hex(content);
  }
  campaign::Submission submission{.campaign_file = yaml,
                                  .file_name = parent.source.file_name(),
                                  .files = {},
                                  .seed = std::nullopt};
  if (parent.source.has_seed()) submission.seed = parent.source.seed();
  submission.files.insert(request.files().begin(), request.files().end());
  request.set_request_id(campaign::IdentityDigest(submission));
  const auto reply = OnceThereIsRoom(session_, parent.status.campaign(),
                                     [&] { return session_.client().Submit(request); });
  RETURN_IF_ERROR(ServersLimit(reply.status()));
  if (!reply->problems().empty()) {
    const v1::Problem& problem = reply->problems(0);
    return absl::InvalidArgumentError(absl::StrCat(
        what, " cannot be run: ",
        campaign::ToString({problem.file(), problem.line(), problem.key(), problem.message()})));
  }
  const std::string& campaign = reply->campaign();
  ASSIGN_OR_RETURN(const auto status, session_.client().Show(campaign));
  RETURN_IF_ERROR(GoOn(status));
  return campaign;
}

absl::Status Laboratory::GoOn(const v1::CampaignStatus& status) {
  if (messages::IsOver(status)) return absl::OkStatus();
  const std::string& campaign = status.campaign();
  if (messages::StateOf(status) == CampaignState::kPaused) {
    std::cerr << "campaign " << campaign << " was paused (" << status.reason() << "); it goes on\n";
    const auto resumed =
        OnceThereIsRoom(session_, campaign, [&] { return session_.client().Resume(campaign); });
    RETURN_IF_ERROR(resumed.status());
  }
  if (!workers_started_ && !choice_.workers && !choice_.state.empty()) {
    RETURN_IF_ERROR(session_.UseWorkers(std::nullopt));
  }
  workers_started_ = true;
  return absl::OkStatus();
}

absl::StatusOr<report::CampaignView> Laboratory::Design(
    const report::CampaignView& parent, const std::string& yaml, const std::string& what,
    const std::map<std::string, std::string>& further) {
  ASSIGN_OR_RETURN(const auto campaign, Submit(parent, yaml, what, further));
  ASSIGN_OR_RETURN(const auto status, session_.client().Show(campaign));
  // Without runs it finishes by itself.
  if (messages::StateOf(status) != CampaignState::kQueued) RETURN_IF_ERROR(Wait(campaign, what));
  return LoadView(session_.client(), campaign);
}

absl::StatusOr<report::CampaignView> Laboratory::Grow(const v1::AddRunsRequest& batch,
                                                      const std::string& what) {
  const auto status =
      OnceThereIsRoom(session_, batch.campaign(), [&] { return session_.client().AddRuns(batch); });
  RETURN_IF_ERROR(ServersLimit(status.status()));
  RETURN_IF_ERROR(GoOn(*status));
  RETURN_IF_ERROR(Wait(batch.campaign(), what));
  return LoadView(session_.client(), batch.campaign());
}

absl::StatusOr<report::CampaignView> Laboratory::Run(
    const report::CampaignView& parent, const std::string& yaml, const std::string& what,
    const std::map<std::string, std::string>& further) {
  ASSIGN_OR_RETURN(const auto campaign, Submit(parent, yaml, what, further));
  RETURN_IF_ERROR(Wait(campaign, what));
  return LoadView(session_.client(), campaign);
}

absl::StatusOr<campaign::Campaign> Laboratory::Read(
    const report::CampaignView& parent, const std::string& yaml,
    const std::map<std::string, std::string>& further) {
  const campaign::FileReader reader =
      [this, &parent, &further](const std::string& path) -> absl::StatusOr<std::string> {
    if (const auto own = further.find(path); own != further.end()) return own->second;
    const auto digest = parent.source.files().find(path);
    if (digest == parent.source.files().end()) return absl::NotFoundError("was not submitted");
    return session_.client().GetBlob(digest->second);
  };
  auto read = campaign::ReadCampaign(methods::All(), yaml, parent.source.file_name(), reader);
  if (!read.problems.empty())
    return absl::InvalidArgumentError(campaign::ToString(read.problems.front()));
  return std::move(read.campaign);
}

}  // namespace calib::client
