#include <iostream>
#include <string>
#include <vector>

#include "calib/return_if_error.h"
#include "server/client/documents.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"
#include "server/report/views/model_comparison.h"

namespace calib::ctl {
namespace {

struct ModelsOptions {
  std::vector<std::string> campaigns{};
};

absl::StatusOr<report::RivalModel> LoadRival(client::Client& client, const std::string& id) {
  ASSIGN_OR_RETURN(const auto source, client.GetSource(id));
  ASSIGN_OR_RETURN(auto read, client::LoadCampaign(client, source));
  ASSIGN_OR_RETURN(auto posterior, client.GetPosterior(id, std::nullopt));
  return report::RivalModel{.campaign = std::move(read), .posterior = std::move(posterior)};
}

void Declare(OptionList& list, ModelsOptions& options) {
  list.Texts("ID", options.campaigns, "campaigns on the same data, two or more").Required();
}

absl::StatusOr<int> Models(const CommonOptions& common, const ModelsOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  std::vector<report::RivalModel> rivals;
  for (const std::string& id : options.campaigns) {
    ASSIGN_OR_RETURN(auto rival, LoadRival(session->client(), id));
    rivals.push_back(std::move(rival));
  }
  std::vector<report::StoredDiagnosis> diagnoses;
  if (const std::string base = report::BaseOf(rivals); !base.empty()) {
    ASSIGN_OR_RETURN(diagnoses, client::DiagnosesOf(session->client(), base));
  }
  ASSIGN_OR_RETURN(const auto comparison, report::CompareModels(rivals, diagnoses));
  std::cout << (common.json ? report::ModelsJson(comparison) : ModelsText(comparison));
  return kDone;
}

}  // namespace

Verb ModelsVerb() {
  return MakeVerb<ModelsOptions>(
      {.name = "models",
       .description = "Which model do the data favour: evidence, Bayes factors, probabilities",
       .example = "models c1 c2 --state calib-state"},
      &Declare, &Models);
}

}  // namespace calib::ctl
