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

constexpr OptionList::Bounds kPriorities{.min = -100, .max = 100};  // as PriorityRequest

struct PriorityOptions {
  std::string campaign{};
  int priority = 0;
};

void Declare(OptionList& list, PriorityOptions& options) {
  list.Campaign(options.campaign);
  list.BoundedNumber("N", options.priority, kPriorities,
                     "whole number: of an owner's campaigns the highest are run first; 0 is that "
                     "of every new one")
      .Required();
}

absl::StatusOr<int> SetPriority(const CommonOptions& common, const PriorityOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto status,
                   session->client().SetPriority(options.campaign, options.priority));
  if (common.json) {
    std::cout << report::StatusJson(status);
  } else {
    std::cout << status.campaign() << " has priority " << status.priority()
              << (status.owner().empty() ? "" : " among the campaigns of " + status.owner())
              << ".\n";
  }
  return kDone;
}

}  // namespace

Verb PriorityVerb() {
  return MakeVerb<PriorityOptions>({.name = "priority",
                                    .description = "Which of an owner's campaigns is run first",
                                    .example = "priority c1 10"},
                                   &Declare, &SetPriority);
}

}  // namespace calib::ctl
