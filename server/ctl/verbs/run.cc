// The whole campaign in one process tree: embedded server, local workers, the answer.
#include <chrono>
#include <iostream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "server/client/interrupt.h"
#include "server/client/load_view.h"
#include "server/client/no_worker_notice.h"
#include "server/client/progress.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/views/warnings.h"

namespace calib::ctl {
namespace {

constexpr const char* kDefaultState = "calib-state";
constexpr std::chrono::milliseconds kPollCampaign{200};

bool IsOver(const v1::CampaignStatus& status) {
  return status.state() == "finished" || status.state() == "failed" ||
         status.state() == "cancelled";
}

// A campaign that an earlier run left paused goes on.
absl::Status TakeUp(client::Client& client, const std::string& campaign) {
  const auto status = client.Show(campaign);
  if (!status.ok()) return status.status();
  if (status->state() != "paused") return absl::OkStatus();
  std::cerr << "campaign " << campaign << " was paused (" << status->reason() << "); it goes on\n";
  return client.Resume(campaign).status();
}

// Shows progress until the campaign is over, pauses by itself (too many failures) or the user
// interrupts.
absl::StatusOr<v1::CampaignStatus> Follow(client::Session& session, const std::string& campaign) {
  client::ProgressLine line;
  client::NoWorkerNotice notice(session);
  for (;;) {
    auto status = session.client().Show(campaign);
    if (!status.ok()) {
      const absl::Status why = session.Check();
      return why.ok() ? status.status() : why;
    }
    constexpr int kMilestones = 5;
    line.Show(client::ProgressText(*status),
              kMilestones * 2 * status->iteration() +
                  kMilestones * status->samples_done() / std::max(1, status->samples()));
    if (IsOver(*status) || status->state() == "paused" || client::Interrupted()) return status;
    notice.Look(*status);
    if (auto alive = session.Check(); !alive.ok()) return alive;
    std::this_thread::sleep_for(kPollCampaign);
  }
}

int PrintAnswer(client::Session& session, const std::string& campaign, bool json) {
  auto view = client::LoadView(session.client(), campaign);
  if (!view.ok()) return Fail(view.status());
  if (view->status.method() == "table") {
    std::cout << (json ? report::TablePosteriorJson(view->status) : TableText(view->status));
    return kDone;
  }
  if (json) {
    std::cout << report::PosteriorJson(view->posterior, view->campaign.parameters);
    return kDone;
  }
  const report::Comparison comparison = report::Compare(*view, report::PredictReadings(*view));
  std::cout << "\n"
            << PosteriorText(view->posterior, report::Warnings(*view)) << "\n"
            << ComparisonText(comparison);
  return kDone;
}

}  // namespace

int Run(const Arguments& given) {
  if (given.server.given) {
    return Fail(absl::InvalidArgumentError(
        "run brings its own server; with --server use submit and watch"));
  }
  Arguments arguments = given;
  if (arguments.server.state.empty()) arguments.server.state = kDefaultState;
  arguments.server.workers.reset();  // started below, once there is something to do
  const auto source = ReadSourceFiles(arguments);
  if (!source) return kBadInput;
  client::CatchInterrupts();
  const auto session = client::Session::Open(arguments.server, /*may_create=*/true);
  if (!session.ok()) return Fail(session.status());
  const auto campaign = SubmitSource((*session)->client(), *source, arguments.seed, arguments.file);
  if (!campaign.ok()) return Fail(campaign.status());
  if (auto taken = TakeUp((*session)->client(), *campaign); !taken.ok()) return Fail(taken);
  auto status = (*session)->client().Show(*campaign);
  if (!status.ok()) return Fail(status.status());
  const bool cancelled_before = status->state() == "cancelled";
  if (!IsOver(*status)) {
    if (!source->outcome.campaign.precomputed) {
      if (auto started = (*session)->UseWorkers(given.server.workers); !started.ok()) {
        return Fail(started);
      }
    }
    std::cerr << "campaign " << *campaign << " in " << arguments.server.state << " with "
              << (*session)->workers() << " worker(s)\n";
    status = Follow(**session, *campaign);
    if (!status.ok()) return Fail(status.status());
  }
  if (status->state() == "finished") return PrintAnswer(**session, *campaign, arguments.json);
  if (cancelled_before) return Fail(CancelledBefore(*campaign));
  if (client::Interrupted()) {
    return Fail(absl::CancelledError(absl::StrCat("stopped; nothing is lost. `calibctl run ",
                                                  arguments.file, " --state ",
                                                  arguments.server.state, "` goes on from here")));
  }
  return Fail(
      absl::AbortedError(absl::StrCat("campaign ", *campaign, " is ", status->state(),
                                      status->reason().empty() ? "" : ": " + status->reason())));
}

}  // namespace calib::ctl
