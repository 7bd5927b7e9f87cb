// The whole campaign in one process tree: embedded server, local workers, the answer.
#include <chrono>
#include <cstdint>
#include <iostream>
#include <optional>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/interrupt.h"
#include "server/client/load_view.h"
#include "server/client/progress.h"
#include "server/client/session.h"
#include "server/client/standstill_notice.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/live_page.h"
#include "server/ctl/option_list.h"
#include "server/ctl/source_files.h"
#include "server/ctl/terminal.h"
#include "server/ctl/verb.h"
#include "server/messages/read_words.h"
#include "server/report/documents/fit_plots.h"
#include "server/report/documents/json_documents.h"
#include "server/report/views/warnings.h"

namespace calib::ctl {

using campaign::CampaignState;

namespace {

struct RunOptions {
  std::string file;
  std::optional<std::uint64_t> seed{};
  std::optional<std::string> http{};  ///< the live page is served, here; empty: at the usual place
};

constexpr const char* kDefaultState = "calib-state";
constexpr std::chrono::milliseconds kPollCampaign{200};

// A campaign that an earlier run left paused goes on.
absl::Status ResumeIfPaused(client::Client& client, const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto status, client.Show(campaign));
  if (messages::StateOf(status) != CampaignState::kPaused) return absl::OkStatus();
  std::cerr << "campaign " << campaign << " was paused (" << status.reason() << "); it goes on\n";
  return client.Resume(campaign).status();
}

// Shows progress until the campaign is over, pauses by itself (too many failures) or the user
// interrupts.
absl::StatusOr<v1::CampaignStatus> Follow(client::Session& session, const std::string& campaign,
                                          LivePage* page) {
  client::ProgressLine line;
  client::StandstillNotice notice(session);
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
    if (messages::IsOver(*status) || messages::StateOf(*status) == CampaignState::kPaused ||
        client::Interrupted())
      return status;
    notice.Look(*status);
    RETURN_IF_ERROR(session.Check());
    if (page != nullptr) page->Follow(session);
    std::this_thread::sleep_for(kPollCampaign);
  }
}

absl::StatusOr<int> PrintAnswer(client::Session& session, const std::string& campaign, bool json) {
  ASSIGN_OR_RETURN(const auto view, client::LoadView(session.client(), campaign));
  if (view.status.infers_nothing()) {
    std::cout << (json ? report::TablePosteriorJson(view.status) : TableText(view.status));
    return kDone;
  }
  if (json) {
    std::cout << report::PosteriorJson(
        view.posterior, view.campaign.parameters,
        report::ShapeOf(view.posterior, view.campaign.parameters, view.samples));
    return kDone;
  }
  const auto predictions = report::PredictReadings(view);
  constexpr int kPlots = 3;  // the answer stays in sight
  std::cout << "\n"
            << PosteriorText(view.posterior, report::Warnings(view)) << "\n"
            << ComparisonText(report::Compare(view, predictions))
            << report::FitPlots(report::Curves(view, predictions), kPlots, ThisTerminal());
  return kDone;
}

void Declare(OptionList& list, RunOptions& options) {
  list.CampaignFile(options.file);
  list.Seed(options.seed);
  list.OptionalText("--http", options.http,
                    std::string("serves the live page while it runs; HOST:PORT of this machine [") +
                        page::kUsualAddress + ", or a free port where that is taken]");
}

absl::StatusOr<int> Run(const CommonOptions& common, const RunOptions& options) {
  if (common.server.given) {
    return absl::InvalidArgumentError(
        "run brings its own server; with --server use submit and watch");
  }
  client::ServerChoice embedded = common.server;
  if (embedded.state.empty()) embedded.state = kDefaultState;
  embedded.workers.reset();  // started below, once there is something to do
  const auto source = ReadSourceFiles(options.file, options.seed, common.json);
  if (!source) return kBadInput;
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(embedded, /*may_create=*/true));
  std::optional<LivePage> page;
  if (options.http) {
    auto served = LivePage::Serve(*session, *options.http, embedded.state);
    if (served.ok()) {
      page = *std::move(served);
      std::cerr << "page: " << page->url() << "\n";
    } else {  // the campaign does not depend on it
      std::cerr << "no page: " << served.status().message() << "\n";
    }
  }
  ASSIGN_OR_RETURN(const auto campaign,
                   SubmitSource(session->client(), *source, options.seed, options.file));
  RETURN_IF_ERROR(ResumeIfPaused(session->client(), campaign));
  ASSIGN_OR_RETURN(auto status, session->client().Show(campaign));
  const bool cancelled_before = messages::StateOf(status) == CampaignState::kCancelled;
  if (!messages::IsOver(status)) {
    if (!source->outcome.campaign.precomputed) {
      RETURN_IF_ERROR(session->UseWorkers(common.server.workers));
    }
    std::cerr << "campaign " << campaign << " in " << embedded.state << " with "
              << session->workers() << " worker(s)\n";
    ASSIGN_OR_RETURN(status, Follow(*session, campaign, page ? &*page : nullptr));
  }
  if (messages::StateOf(status) == CampaignState::kFinished)
    return PrintAnswer(*session, campaign, common.json);
  if (cancelled_before) return CancelledBefore(campaign);
  if (client::Interrupted()) {
    return absl::CancelledError(absl::StrCat("stopped; nothing is lost. `calibctl run ",
                                             options.file, " --state ", embedded.state,
                                             "` goes on from here"));
  }
  return absl::AbortedError(absl::StrCat("campaign ", campaign, " is ", status.state(),
                                         status.reason().empty() ? "" : ": " + status.reason()));
}

}  // namespace

Verb RunVerb() {
  return MakeVerb<RunOptions>(
      {.name = "run",
       .description =
           "The whole campaign on this machine: server, workers and answer in one command",
       .example = "run sand.yaml --workers 2 --state calib-state"},
      &Declare, &Run);
}

}  // namespace calib::ctl
