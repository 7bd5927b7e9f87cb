#include <algorithm>
#include <iostream>
#include <iterator>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/lineage.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {
namespace {

// What comes from a campaign cannot be found by it any more once it is gone: diagnose and improve
// would run everything again, and reports lose what was tried.
absl::Status CheckChildren(const Arguments& arguments,
                           const std::vector<v1::CampaignStatus>& campaigns,
                           const std::vector<v1::CampaignStatus>& children) {
  if (children.empty() || arguments.force) return absl::OkStatus();
  if (!arguments.with_children) {
    return absl::FailedPreconditionError(absl::StrCat(
        arguments.campaign, " is not deleted: ", children.size(),
        children.size() == 1 ? " campaign comes" : " campaigns come", " from it (",
        CountedByPurpose(children), "; `calibctl list` shows them below it); delete them with it: ",
        "--with-children, or ", arguments.campaign, " alone: --force"));
  }
  std::vector<v1::CampaignStatus> leaving = children;
  std::copy_if(campaigns.begin(), campaigns.end(), std::back_inserter(leaving),
               [&arguments](const auto& c) { return c.campaign() == arguments.campaign; });
  for (const v1::CampaignStatus& one : leaving) {
    if (one.state() == "finished" || one.state() == "failed" || one.state() == "cancelled") {
      continue;
    }
    const bool parent = one.campaign() == arguments.campaign;
    return absl::FailedPreconditionError(
        absl::StrCat("nothing is deleted: ", one.campaign(),
                     parent ? "" : ", which comes from " + arguments.campaign + ",", " is ",
                     one.state(), "; cancel it first"));
  }
  return absl::OkStatus();
}

}  // namespace

int Delete(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  client::Client& client = (*session)->client();
  const auto campaigns = client.List();
  if (!campaigns.ok()) return Fail(campaigns.status());
  const std::vector<v1::CampaignStatus> children = Descendants(*campaigns, arguments.campaign);
  if (auto status = CheckChildren(arguments, *campaigns, children); !status.ok())
    return Fail(status);
  std::vector<std::string> leaving = {arguments.campaign};
  if (arguments.with_children) {
    for (const v1::CampaignStatus& child : children) leaving.push_back(child.campaign());
  }
  std::reverse(leaving.begin(), leaving.end());  // no child is ever without its parent
  for (const std::string& campaign : leaving) {
    if (auto deleted = client.Delete(campaign); !deleted.ok()) return Fail(deleted);
  }
  if (arguments.json) {
    std::cout << "{\"deleted\": true, \"campaigns\": " << leaving.size() << "}\n";
    return kDone;
  }
  std::cout << arguments.campaign
            << (leaving.size() == 1 ? " is deleted.\n"
                                    : absl::StrCat(" and ", leaving.size() - 1,
                                                   " that came from it are deleted.\n"));
  if (arguments.force && !children.empty()) {
    std::cout << children.size() << " that came from it stay: " << CountedByPurpose(children)
              << ".\n";
  }
  return kDone;
}

}  // namespace calib::ctl
