#include "server/ctl/control.h"

#include <iostream>

#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

int Control(const Arguments& arguments, ControlCall call) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto status = ((*session)->client().*call)(arguments.campaign);
  if (!status.ok()) return Fail(status.status());
  if (arguments.json) {
    std::cout << report::StatusJson(*status);
  } else {
    std::cout << status->campaign() << " is " << status->state() << ".\n";
  }
  return kDone;
}

}  // namespace calib::ctl
