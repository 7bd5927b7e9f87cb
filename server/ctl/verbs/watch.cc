#include <iostream>
#include <optional>

#include "server/client/no_worker_notice.h"
#include "server/client/progress.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

int Watch(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  std::optional<v1::CampaignStatus> last;
  absl::Status ended;
  // The server speaks only when something changes, which nothing does without workers.
  client::NoWorkerNotice notice(**session, std::chrono::milliseconds(0));
  {
    client::ProgressLine line;
    ended = (*session)->client().Watch(arguments.campaign, [&](const v1::CampaignStatus& status) {
      last = status;
      if (arguments.server.workers.value_or(0) == 0)
        notice.Look(status);  // else they are on their way
      line.Show(
          client::ProgressText(status),
          10 * status.iteration() + 10 * status.samples_done() / std::max(1, status.samples()));
    });
  }
  if (!ended.ok()) {
    const absl::Status why = (*session)->Check();
    return Fail(why.ok() ? ended : why);
  }
  if (last && arguments.json) std::cout << report::StatusJson(*last);
  const bool good = last && last->state() == "finished";
  if (last && !arguments.json) {
    std::cout << last->campaign() << " is " << client::ProgressText(*last) << ".\n";
  }
  return good ? kDone : kFailed;
}

}  // namespace calib::ctl
