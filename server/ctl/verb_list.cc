#include <fmt/format.h>

#include <iostream>

#include "server/ctl/exit_codes.h"
#include "server/ctl/lineage.h"
#include "server/ctl/session.h"
#include "server/ctl/text_table.h"
#include "server/ctl/verbs.h"
#include "server/report/json_documents.h"
#include "server/report/people_units.h"

namespace calib::ctl {
namespace {

// A parent that is not above it has been deleted.
std::string Purpose(const Branch& branch) {
  const v1::CampaignStatus& s = branch.status;
  const bool orphan = branch.depth == 0 && !s.parent().empty();
  return orphan ? s.purpose() + " of " + s.parent() + ", gone" : s.purpose();
}

}  // namespace

int List(const Arguments& arguments) {
  const auto session = Session::Open(arguments);
  if (!session.ok()) return Fail(session.status());
  const auto campaigns = (*session)->client().List();
  if (!campaigns.ok()) return Fail(campaigns.status());
  if (arguments.json) {
    std::cout << report::StatusListJson(*campaigns);
    return kDone;
  }
  TextTable table({"<id", "<name", "<purpose", "<state", "iteration", "samples", "evaluations",
                   "core hours", "misfit"});
  for (const Branch& branch : AsTree(*campaigns)) {
    const v1::CampaignStatus& s = branch.status;
    table.AddRow({std::string(static_cast<std::size_t>(2 * branch.depth), ' ') + s.campaign(),
                  s.name(), Purpose(branch), s.state(),
                  fmt::format("{}/{}", s.iteration() + 1, s.max_iterations()),
                  fmt::format("{}/{}", s.samples_done(), s.samples()),
                  std::to_string(s.model_evaluations()), report::Number(s.core_hours(), 3),
                  s.best_misfit() > 0 ? report::Number(s.best_misfit(), 3) : "–"});
  }
  std::cout << (campaigns->empty()
                    ? "There are no campaigns yet; `calibctl submit FILE` makes one.\n"
                    : table.ToString());
  return kDone;
}

}  // namespace calib::ctl
