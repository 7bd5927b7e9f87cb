#include <cstdint>
#include <iostream>
#include <optional>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verb.h"
#include "server/messages/read_words.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

struct SubmitOptions {
  std::string file;
  std::optional<std::uint64_t> seed{};
};

void Declare(OptionList& list, SubmitOptions& options) {
  list.CampaignFile(options.file);
  list.Seed(options.seed);
}

absl::StatusOr<int> Submit(const CommonOptions& common, const SubmitOptions& options) {
  const auto source = ReadSourceFiles(options.file, options.seed, common.json);
  if (!source) return kBadInput;
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server, /*may_create=*/true));
  ASSIGN_OR_RETURN(const auto campaign,
                   SubmitSource(session->client(), *source, options.seed, options.file));
  ASSIGN_OR_RETURN(const auto status, session->client().Show(campaign));
  if (messages::StateOf(status) == campaign::CampaignState::kCancelled)
    return CancelledBefore(campaign);
  if (common.json) {
    std::cout << report::StatusJson(status);
  } else {
    std::cout << campaign << "\n";
  }
  return kDone;
}

}  // namespace

Verb SubmitVerb() {
  return MakeVerb<SubmitOptions>({.name = "submit",
                                  .description = "Validate and submit; prints the campaign id",
                                  .example = "submit sand.yaml --server node1:7443"},
                                 &Declare, &Submit);
}

}  // namespace calib::ctl
