#include <iostream>

#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

std::string State(const v1::WorkerInfo& w) {
  const std::string since = report::Duration(w.seconds_since_heard());
  if (w.left()) return (w.draining() ? "drained " : "left ") + since + " ago";
  if (!w.connected()) return "silent for " + since;
  if (!w.waits().empty()) return w.waits();
  return w.draining() ? "draining" : "ready";
}

absl::StatusOr<int> Workers(const CommonOptions& common) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto workers, session->client().ListWorkers());
  if (common.json) {
    std::cout << report::WorkersJson(workers);
    return kDone;
  }
  if (workers.empty()) {
    std::cout << "No worker is connected; start one with `calib-worker --server HOST:PORT`.\n";
  }
  report::TextTable table({"<worker", "busy", "slots", "million contacts/s", "<state", "<running"});
  for (const v1::WorkerInfo& w : workers) {
    std::string running;
    for (const std::string& what : w.running()) running += (running.empty() ? "" : " ") + what;
    table.AddRow({w.name(), std::to_string(w.busy()), std::to_string(w.slots()),
                  report::Number(w.contact_updates_per_second() / 1e6, 3), State(w), running});
  }
  std::cout << table.ToString();
  return kDone;
}

}  // namespace

Verb WorkersVerb() {
  return {.help = {.name = "workers",
                   .description = "Nodes, slots, speed, running samples",
                   .example = "workers"},
          .run = &Workers};
}

}  // namespace calib::ctl
