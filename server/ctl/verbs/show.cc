#include <fmt/format.h>
#include <fmt/ranges.h>

#include <ctime>
#include <iostream>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/documents.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/messages/read_words.h"
#include "server/report/text/text_table.h"
#include "server/report/views/lineage.h"

namespace calib::ctl {
namespace {

struct ShowOptions {
  std::string campaign;
};

std::string Clock(std::int64_t unix_ms) {
  const std::time_t seconds = unix_ms / 1000;
  std::tm local{};
  localtime_r(&seconds, &local);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}", local.tm_year + 1900, local.tm_mon + 1,
                     local.tm_mday, local.tm_hour, local.tm_min, local.tm_sec);
}

std::string Named(const std::string& campaign, const absl::StatusOr<v1::CampaignStatus>& status) {
  return status.ok() ? campaign + " (" + status->name() + ")"
                     : campaign + ", which has been deleted";
}

// Parent and children, extensions by name, trials of diagnose by their number.
std::string Family(const v1::CampaignStatus& status,
                   const absl::StatusOr<v1::CampaignStatus>& parent,
                   const std::vector<v1::CampaignStatus>& campaigns) {
  std::string text;
  if (!status.parent().empty()) {
    text += fmt::format("Made from {} as {}.\n", Named(status.parent(), parent),
                        status.purpose().empty() ? "a derived campaign" : status.purpose());
  }
  std::vector<v1::CampaignStatus> trials;
  for (const v1::CampaignStatus& child : report::ChildrenOf(campaigns, status.campaign())) {
    if (messages::PurposeOf(child) != campaign::DerivedFor::kExtension) {
      trials.push_back(child);
      continue;
    }
    text += fmt::format("Extended with {}: {}, {}.\n", fmt::join(child.effects(), " + "),
                        child.campaign(), child.state());
  }
  if (!trials.empty()) {
    text += fmt::format("Made from it: {} ({} to {}).\n", report::CountedByPurpose(trials),
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

void Declare(OptionList& list, ShowOptions& options) { list.Campaign(options.campaign); }

absl::StatusOr<int> Show(const CommonOptions& common, const ShowOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Client& client = session->client();
  if (common.json) {
    ASSIGN_OR_RETURN(const auto document, client::ShowDocument(client, options.campaign));
    std::cout << document;
    return kDone;
  }
  ASSIGN_OR_RETURN(const auto status, client.Show(options.campaign));
  ASSIGN_OR_RETURN(const auto campaigns, client.List({.parent = options.campaign}));
  absl::StatusOr<v1::CampaignStatus> parent;
  if (!status.parent().empty()) parent = client.Show(status.parent());
  if (!parent.ok() && !absl::IsNotFound(parent.status()) && !status.parent().empty()) {
    return parent.status();
  }
  ASSIGN_OR_RETURN(const auto findings, client.Findings(options.campaign));
  ASSIGN_OR_RETURN(const auto warnings, client::WarningsOf(client, options.campaign));
  std::cout << StatusText(status);
  for (const std::string& warning : warnings) std::cout << report::Wrapped(warning, "! ", "  ");
  std::cout << Family(status, parent, campaigns) << Concluded(findings);
  ASSIGN_OR_RETURN(const auto log, client.GetLog(options.campaign));
  constexpr std::size_t kShown = 10;
  const std::size_t first = log.size() > kShown ? log.size() - kShown : 0;
  for (std::size_t i = first; i < log.size(); ++i) {
    std::cout << Clock(log[i].unix_ms()) << "  " << log[i].what() << "\n";
  }
  return kDone;
}

}  // namespace

Verb ShowVerb() {
  return MakeVerb<ShowOptions>({.name = "show",
                                .description = "State of a campaign",
                                .example = "show c1 --state calib-state"},
                               &Declare, &Show);
}

}  // namespace calib::ctl
