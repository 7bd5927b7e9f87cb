#include <iostream>
#include <optional>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/load_view.h"
#include "server/client/progress.h"
#include "server/client/session.h"
#include "server/client/standstill_notice.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/terminal.h"
#include "server/ctl/verb.h"
#include "server/messages/read_words.h"
#include "server/report/documents/fit_plots.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

constexpr int kPlots = 3;  // what is said of the end stays in sight

struct WatchOptions {
  std::string campaign;
};

void Declare(OptionList& list, WatchOptions& options) { list.Campaign(options.campaign); }

absl::StatusOr<int> Watch(const CommonOptions& common, const WatchOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  std::optional<v1::CampaignStatus> last;
  absl::Status ended;
  // The server speaks only when something changes, which nothing does without workers.
  client::StandstillNotice notice(*session, std::chrono::milliseconds(0));
  {
    client::ProgressLine line;
    ended = session->client().Watch(options.campaign, [&](const v1::CampaignStatus& status) {
      last = status;
      if (common.server.workers.value_or(0) == 0) {
        notice.Look(status);
      } else {  // they are on their way
        notice.LookAtServer(status);
      }
      line.Show(
          client::ProgressText(status),
          10 * status.iteration() + 10 * status.samples_done() / std::max(1, status.samples()));
    });
  }
  if (!ended.ok()) {
    const absl::Status why = session->Check();
    return why.ok() ? ended : why;
  }
  if (last && common.json) std::cout << report::StatusJson(*last);
  const bool good = last && messages::StateOf(*last) == campaign::CampaignState::kFinished;
  if (last && !common.json) {
    std::cout << last->campaign() << " is " << client::ProgressText(*last) << ".\n";
    if (good && !last->infers_nothing()) {
      ASSIGN_OR_RETURN(const auto view, client::LoadView(session->client(), options.campaign));
      std::cout << report::FitPlots(report::Curves(view, report::PredictReadings(view)), kPlots,
                                    ThisTerminal());
    }
  }
  return good ? kDone : kFailed;
}

}  // namespace

Verb WatchVerb() {
  return MakeVerb<WatchOptions>({.name = "watch",
                                 .description = "Live view until the campaign ends",
                                 .example = "watch c1 --state calib-state"},
                                &Declare, &Watch);
}

}  // namespace calib::ctl
