#include <iostream>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

struct DrainOptions {
  std::string worker;  ///< name
};

void Declare(OptionList& list, DrainOptions& options) {
  list.Text("WORKER", options.worker, "name, as shown by `calibctl workers`").Required();
}

absl::StatusOr<int> Drain(const CommonOptions& common, const DrainOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto worker, session->client().DrainWorker(options.worker));
  if (common.json) {
    std::cout << report::WorkersJson({worker});
  } else {
    std::cout << worker.name() << " finishes what it does (" << worker.busy()
              << " running) and then leaves.\n";
  }
  return kDone;
}

}  // namespace

Verb DrainVerb() {
  return MakeVerb<DrainOptions>({.name = "drain",
                                 .description = "Let a worker finish what it does and leave",
                                 .example = "drain node1-4711"},
                                &Declare, &Drain);
}

}  // namespace calib::ctl
