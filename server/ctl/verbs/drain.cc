#include <iostream>

#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

int Drain(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto worker = (*session)->client().DrainWorker(arguments.worker);
  if (!worker.ok()) return Fail(worker.status());
  if (arguments.json) {
    std::cout << report::WorkersJson({*worker});
  } else {
    std::cout << worker->name() << " finishes what it does (" << worker->busy()
              << " running) and then leaves.\n";
  }
  return kDone;
}

}  // namespace calib::ctl
