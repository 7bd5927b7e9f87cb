#include "server/report/views/sensitivity.h"

#include <iostream>

#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

int Sensitivity(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto view = client::LoadView((*session)->client(), arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  const auto sensitivity = report::AnalyseCampaign(*view);
  if (!sensitivity.ok()) return Fail(sensitivity.status());
  std::cout << (arguments.json ? report::SensitivityJson(arguments.campaign, *sensitivity)
                               : SensitivityText(*sensitivity));
  return kDone;
}

}  // namespace calib::ctl
