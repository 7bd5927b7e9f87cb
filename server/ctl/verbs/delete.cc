#include <algorithm>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/messages/read_words.h"
#include "server/report/views/lineage.h"

namespace calib::ctl {
namespace {

struct DeleteOptions {
  std::string campaign;
  bool with_children = false;  ///< what comes from the campaign is deleted too
  bool force = false;          ///< although something comes from it
};

// What comes from a campaign cannot be found by it any more once it is gone: diagnose and improve
// would run everything again, and reports lose what was tried.
absl::Status CheckChildren(const DeleteOptions& options,
                           const std::vector<v1::CampaignStatus>& campaigns,
                           const std::vector<v1::CampaignStatus>& children) {
  if (children.empty() || options.force) return absl::OkStatus();
  if (!options.with_children) {
    return absl::FailedPreconditionError(absl::StrCat(
        options.campaign, " is not deleted: ", children.size(),
        children.size() == 1 ? " campaign comes" : " campaigns come", " from it (",
        report::CountedByPurpose(children),
        "; `calibctl list` shows them below it); delete them with it: ", "--with-children, or ",
        options.campaign, " alone: --force"));
  }
  std::vector<v1::CampaignStatus> leaving = children;
  std::copy_if(campaigns.begin(), campaigns.end(), std::back_inserter(leaving),
               [&options](const auto& c) { return c.campaign() == options.campaign; });
  for (const v1::CampaignStatus& one : leaving) {
    if (messages::IsOver(one)) continue;
    const bool parent = one.campaign() == options.campaign;
    return absl::FailedPreconditionError(
        absl::StrCat("nothing is deleted: ", one.campaign(),
                     parent ? "" : ", which comes from " + options.campaign + ",", " is ",
                     one.state(), "; cancel it first"));
  }
  return absl::OkStatus();
}

void Declare(OptionList& list, DeleteOptions& options) {
  list.Campaign(options.campaign);
  const Option children =
      list.Flag("--with-children", options.with_children,
                "everything that diagnose, extend and improve made from it too");
  list.Flag("--force", options.force,
            "although campaigns come from it, which stay without their parent")
      .Excludes(children);
}

absl::StatusOr<int> Delete(const CommonOptions& common, const DeleteOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Client& client = session->client();
  ASSIGN_OR_RETURN(const auto campaigns, client.List());
  const std::vector<v1::CampaignStatus> children = report::Descendants(campaigns, options.campaign);
  RETURN_IF_ERROR(CheckChildren(options, campaigns, children));
  std::vector<std::string> leaving = {options.campaign};
  if (options.with_children) {
    for (const v1::CampaignStatus& child : children) leaving.push_back(child.campaign());
  }
  std::reverse(leaving.begin(), leaving.end());  // no child is ever without its parent
  for (const std::string& campaign : leaving) {
    RETURN_IF_ERROR(client.Delete(campaign));
  }
  if (common.json) {
    std::cout << "{\"deleted\": true, \"campaigns\": " << leaving.size() << "}\n";
    return kDone;
  }
  std::cout << options.campaign
            << (leaving.size() == 1 ? " is deleted.\n"
                                    : absl::StrCat(" and ", leaving.size() - 1,
                                                   " that came from it are deleted.\n"));
  if (options.force && !children.empty()) {
    std::cout << children.size()
              << " that came from it stay: " << report::CountedByPurpose(children) << ".\n";
  }
  return kDone;
}

}  // namespace

Verb DeleteVerb() {
  return MakeVerb<DeleteOptions>({.name = "delete",
                                  .description = "Remove an ended campaign and all its data",
                                  .example = "delete c1 --state calib-state"},
                                 &Declare, &Delete);
}

}  // namespace calib::ctl
