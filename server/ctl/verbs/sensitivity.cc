#include "server/report/views/sensitivity.h"

#include <iostream>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

struct SensitivityOptions {
  std::string campaign;
};

void Declare(OptionList& list, SensitivityOptions& options) { list.Campaign(options.campaign); }

absl::StatusOr<int> Sensitivity(const CommonOptions& common, const SensitivityOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto view, client::LoadView(session->client(), options.campaign));
  ASSIGN_OR_RETURN(const auto sensitivity, report::AnalyseCampaign(view));
  std::cout << (common.json ? report::SensitivityJson(options.campaign, sensitivity)
                            : SensitivityText(sensitivity));
  return kDone;
}

}  // namespace

Verb SensitivityVerb() {
  return MakeVerb<SensitivityOptions>(
      {.name = "sensitivity",
       .description =
           "Which parameters move what: Sobol indices, correlations with bulk properties",
       .example = "sensitivity c1 --state calib-state"},
      &Declare, &Sensitivity);
}

}  // namespace calib::ctl
