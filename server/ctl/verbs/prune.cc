// What nobody needs any more: contents without a name and, where asked to, states.
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"

namespace calib::ctl {
namespace {

struct PruneOptions {
  std::optional<int> keep_states{};
};

void Declare(OptionList& list, PruneOptions& options) {
  list.WholeNumber("--keep-states", options.keep_states,
                   "N: of each campaign that is over, the states of N samples of largest weight "
                   "stay; compare, diagnose and predict need all [all]");
}

absl::StatusOr<int> Prune(const CommonOptions& common, const PruneOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto pruned, session->client().Prune(options.keep_states));
  if (common.json) {
    std::cout << nlohmann::ordered_json{{"contents", pruned.contents()},
                                        {"campaigns", pruned.campaigns()}}
                     .dump(2)
              << "\n";
    return kDone;
  }
  const auto counted = [](std::int64_t count, const char* one) {
    return absl::StrCat(count, " ", one, count == 1 ? "" : "s");
  };
  std::cout << counted(pruned.contents(), "content") << " that nobody names"
            << (options.keep_states
                    ? absl::StrCat(" and states of ", counted(pruned.campaigns(), "campaign"))
                    : "")
            << " leave; the room comes back in pieces, beside what runs.\n";
  return kDone;
}

}  // namespace

Verb PruneVerb() {
  return MakeVerb<PruneOptions>(
      {.name = "prune",
       .description = "Remove what nobody needs any more, as states of campaigns that are over",
       .example = "prune --keep-states 20"},
      &Declare, &Prune);
}

}  // namespace calib::ctl
