#include "server/report/views/lineage.h"

#include <iostream>
#include <string>

#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/client/documents.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct LineageOptions {
  std::string campaign;
};

void Declare(OptionList& list, LineageOptions& options) { list.Campaign(options.campaign); }

absl::StatusOr<int> Lineage(const CommonOptions& common, const LineageOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  if (common.json) {
    ASSIGN_OR_RETURN(const auto document,
                     client::LineageDocument(session->client(), options.campaign));
    std::cout << document;
    return kDone;
  }
  ASSIGN_OR_RETURN(const auto family, client::FamilyOf(session->client(), options.campaign));
  report::TextTable table({"<campaign", "<made for", "<state", "<effects", "<name"});
  for (const report::Branch& branch : family) {
    const v1::CampaignStatus& s = branch.status;
    table.AddRow({std::string(static_cast<std::size_t>(2 * branch.depth), ' ') + s.campaign(),
                  s.purpose().empty() ? "–" : s.purpose(), s.state(),
                  s.effects().empty() ? "none" : absl::StrJoin(s.effects(), " + "), s.name()});
  }
  std::cout << table.ToString();
  return kDone;
}

}  // namespace

Verb LineageVerb() {
  return MakeVerb<LineageOptions>(
      {.name = "lineage",
       .description = "What a campaign comes from, and what comes from it",
       .example = "lineage c1 --state calib-state"},
      &Declare, &Lineage);
}

}  // namespace calib::ctl
