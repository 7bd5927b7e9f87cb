#include <fmt/format.h>

#include <iostream>
#include <map>
#include <optional>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/documents.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"
#include "server/report/views/lineage.h"

namespace calib::ctl {
namespace {

// Below its parent the parent's name goes without saying, its purpose does not. A parent that is
// not above it has been deleted.
std::string Name(const report::Branch& branch, const std::map<std::string, std::string>& names) {
  const v1::CampaignStatus& s = branch.status;
  if (s.parent().empty()) return s.name();
  if (branch.depth == 0) return s.purpose() + " of " + s.parent() + ", gone: " + s.name();
  std::string own = s.name();
  const std::string& parent = names.at(s.parent());
  if (own.starts_with(parent)) own.erase(0, parent.size());
  const std::size_t begin = own.find_first_not_of(": ");
  own = begin == std::string::npos ? s.name() : own.substr(begin);
  return s.purpose().empty() ? own : s.purpose() + ": " + own;
}

struct ListOptions {
  std::optional<int> limit{};
  std::string after{};
};

void Declare(OptionList& list, ListOptions& options) {
  list.WholeNumber("--limit", options.limit, "at most so many [all]");
  list.Text("--after", options.after, "ID: those behind this one");
}

absl::StatusOr<int> List(const CommonOptions& common, const ListOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto campaigns,
                   session->client().List({.limit = options.limit, .after = options.after}));
  if (common.json) {
    std::cout << report::StatusListJson(campaigns);
    return kDone;
  }
  report::TextTable table(
      {"<id", "<name", "<state", "iteration", "samples", "evaluations", "core hours", "misfit"});
  std::map<std::string, std::string> names;
  for (const v1::CampaignStatus& s : campaigns) names[s.campaign()] = s.name();
  for (const report::Branch& branch : report::AsTree(campaigns)) {
    const v1::CampaignStatus& s = branch.status;
    table.AddRow({std::string(static_cast<std::size_t>(2 * branch.depth), ' ') + s.campaign(),
                  Name(branch, names), s.state(),
                  fmt::format("{}/{}", s.iteration() + 1, s.max_iterations()),
                  fmt::format("{}/{}", s.samples_done(), s.samples()),
                  std::to_string(s.model_evaluations()), report::Number(s.core_hours(), 3),
                  s.best_misfit() > 0 ? report::Number(s.best_misfit(), 3) : "–"});
  }
  std::cout << (campaigns.empty()
                    ? "There are no campaigns yet; `calibctl submit FILE` makes one.\n"
                    : table.ToString());
  for (const v1::CampaignStatus& s : campaigns) {
    if (!s.problem().empty())
      std::cout << report::Wrapped(s.campaign() + ": " + s.problem(), "! ", "  ");
  }
  if (!campaigns.empty() && !campaigns.front().server_waits().empty()) {  // the same of all
    std::cout << report::Wrapped(campaigns.front().server_waits(), "! ", "  ");
  }
  return kDone;
}

}  // namespace

Verb ListVerb() {
  return MakeVerb<ListOptions>({.name = "list", .description = "All campaigns", .example = "list"},
                               &Declare, &List);
}

}  // namespace calib::ctl
