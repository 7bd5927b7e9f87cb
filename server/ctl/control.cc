#include "server/ctl/control.h"

#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/messages/read_words.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

Verb ControlVerb(const std::string& name, const std::string& description, ControlCall call) {
  const auto campaign = std::make_shared<std::string>();
  const auto run = [campaign, call](const CommonOptions& common) -> absl::StatusOr<int> {
    ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
    ASSIGN_OR_RETURN(const auto status, (session->client().*call)(*campaign));
    if (common.json) {
      std::cout << report::StatusJson(status);
    } else {
      const auto state = messages::StateOf(status);
      const bool goes_on =
          state == campaign::CampaignState::kQueued || state == campaign::CampaignState::kRunning;
      std::cout << status.campaign() << " is " << status.state()
                << (goes_on && !session->is_guest()
                        ? absl::StrCat("; nobody serves ", common.server.state,
                                       " now: it goes on with `calibctl watch ", status.campaign(),
                                       " --state ", common.server.state, " --workers N`.\n")
                        : ".\n");
    }
    return kDone;
  };
  return {.help = {.name = name,
                   .description = description,
                   .example = name + " c1 --state calib-state"},
          .declare = [campaign](OptionList& list) { list.Campaign(*campaign); },
          .run = run};
}

}  // namespace calib::ctl
