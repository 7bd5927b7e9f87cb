#include <fmt/format.h>
#include <fmt/ranges.h>

#include <ctime>
#include <iostream>

#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/lineage.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

std::string Clock(std::int64_t unix_ms) {
  const std::time_t seconds = unix_ms / 1000;
  std::tm local{};
  localtime_r(&seconds, &local);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}", local.tm_year + 1900, local.tm_mon + 1,
                     local.tm_mday, local.tm_hour, local.tm_min, local.tm_sec);
}

std::string Named(const std::string& campaign, const std::vector<v1::CampaignStatus>& campaigns) {
  for (const v1::CampaignStatus& other : campaigns) {
    if (other.campaign() == campaign) return campaign + " (" + other.name() + ")";
  }
  return campaign + ", which has been deleted";
}

// Parent and children, extensions by name, trials of diagnose by their number.
std::string Family(const v1::CampaignStatus& status,
                   const std::vector<v1::CampaignStatus>& campaigns) {
  std::string text;
  if (!status.parent().empty()) {
    text += fmt::format("Made from {} as {}.\n", Named(status.parent(), campaigns),
                        status.purpose().empty() ? "a derived campaign" : status.purpose());
  }
  std::vector<v1::CampaignStatus> trials;
  for (const v1::CampaignStatus& child : ChildrenOf(campaigns, status.campaign())) {
    if (child.purpose() != "extension") {
      trials.push_back(child);
      continue;
    }
    text += fmt::format("Extended with {}: {}, {}.\n", fmt::join(child.effects(), " + "),
                        child.campaign(), child.state());
  }
  if (!trials.empty()) {
    text += fmt::format("Made from it: {} ({} to {}).\n", CountedByPurpose(trials),
                        trials.front().campaign(), trials.back().campaign());
  }
  return text;
}

std::string Concluded(const std::vector<v1::Finding>& findings) {
  std::string text;
  for (const v1::Finding& finding : findings) {
    text += fmt::format("{}  {} kept, SHA-256 {}\n", Clock(finding.created_unix_ms()),
                        finding.kind(), finding.digest());
  }
  return text;
}

}  // namespace

int Show(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  client::Client& client = (*session)->client();
  const auto status = client.Show(arguments.campaign);
  if (!status.ok()) return Fail(status.status());
  const auto campaigns = client.List();
  if (!campaigns.ok()) return Fail(campaigns.status());
  const auto findings = client.Findings(arguments.campaign);
  if (!findings.ok()) return Fail(findings.status());
  if (arguments.json) {
    std::cout << report::ShownJson(*status, ChildrenOf(*campaigns, arguments.campaign), *findings);
    return kDone;
  }
  std::cout << StatusText(*status) << Family(*status, *campaigns) << Concluded(*findings);
  const auto log = client.GetLog(arguments.campaign);
  if (!log.ok()) return Fail(log.status());
  constexpr std::size_t kShown = 10;
  const std::size_t first = log->size() > kShown ? log->size() - kShown : 0;
  for (std::size_t i = first; i < log->size(); ++i) {
    std::cout << Clock((*log)[i].unix_ms()) << "  " << (*log)[i].what() << "\n";
  }
  return kDone;
}

}  // namespace calib::ctl
