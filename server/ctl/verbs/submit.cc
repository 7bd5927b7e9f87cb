#include <iostream>

#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

int Submit(const Arguments& arguments) {
  const auto source = ReadSourceFiles(arguments);
  if (!source) return kBadInput;
  const auto session = client::Session::Open(arguments.server, /*may_create=*/true);
  if (!session.ok()) return Fail(session.status());
  const auto campaign = SubmitSource((*session)->client(), *source, arguments.seed, arguments.file);
  if (!campaign.ok()) return Fail(campaign.status());
  const auto status = (*session)->client().Show(*campaign);
  if (!status.ok()) return Fail(status.status());
  if (status->state() == "cancelled") return Fail(CancelledBefore(*campaign));
  if (arguments.json) {
    std::cout << report::StatusJson(*status);
  } else {
    std::cout << *campaign << "\n";
  }
  return kDone;
}

}  // namespace calib::ctl
