#include <chrono>
#include <iostream>
#include <string>
#include <thread>

#include "calib/return_if_error.h"
#include "server/client/interrupt.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/live_page.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"

namespace calib::ctl {
namespace {

constexpr std::chrono::milliseconds kBetweenInterrupts{100};
constexpr int kInterruptsPerLook = 10;  // a second between looks at the server

struct PageVerbOptions {
  std::string http{};
};

void Declare(OptionList& list, PageVerbOptions& options) {
  list.Text("--http", options.http,
            std::string("HOST:PORT of this machine [") + page::kUsualAddress +
                ", or a free port where that is taken]");
}

absl::StatusOr<int> ServeUntilInterrupted(const CommonOptions& common,
                                          const PageVerbOptions& options) {
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(auto page, LivePage::Serve(*session, options.http, common.server.state));
  std::cout << page.url() << std::endl;
  std::cerr << "Open it in a browser of this machine; Ctrl-C ends it.\n";
  for (int k = 1; !client::Interrupted(); ++k) {
    std::this_thread::sleep_for(kBetweenInterrupts);
    if (k % kInterruptsPerLook != 0) continue;
    // Where the process that served the folder has ended, asking it takes its place.
    (void)session->client().ListWorkers();
    RETURN_IF_ERROR(session->Check());
    page.Follow(*session);
  }
  return kDone;
}

}  // namespace

Verb PageVerb() {
  return MakeVerb<PageVerbOptions>({.name = "page",
                                    .description = "Live page in a browser; it only reads",
                                    .example = "page --state calib-state"},
                                   &Declare, &ServeUntilInterrupted);
}

}  // namespace calib::ctl
