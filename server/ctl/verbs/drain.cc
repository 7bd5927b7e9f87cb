#include <chrono>
#include <cmath>
#include <iostream>
#include <string>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/text/quantity.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

constexpr double kLeastTime = 0.001;  // s, what the wire can say
constexpr double kLongestTime = 86'400;

struct DrainOptions {
  std::string worker;  ///< name
  std::string within;  ///< a time; empty: as long as its runs take
};

void Declare(OptionList& list, DrainOptions& options) {
  list.Text("WORKER", options.worker, "name, as shown by `calibctl workers`").Required();
  list.Text("--within", options.within,
            "time, as 60 s, after which runs leave a checkpoint and go on elsewhere [they end]");
}

absl::StatusOr<int> Drain(const CommonOptions& common, const DrainOptions& options) {
  std::chrono::milliseconds within{0};
  if (!options.within.empty()) {
    const auto seconds = campaign::ParseQuantity(options.within, "s");
    if (!seconds.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("--within: ", seconds.status().message()));
    }
    if (!(*seconds >= kLeastTime && *seconds <= kLongestTime)) {
      return absl::InvalidArgumentError(
          absl::StrCat("--within: ", options.within, " is not between 0.001 s and a day"));
    }
    within = std::chrono::milliseconds(std::llround(1000 * *seconds));
  }
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto worker, session->client().DrainWorker(options.worker, within));
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
