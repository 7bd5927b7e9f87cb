#include <iostream>

#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

int Posterior(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto posterior = (*session)->client().GetPosterior(arguments.campaign, arguments.iteration);
  if (!posterior.ok()) return Fail(posterior.status());
  if (arguments.json) {
    const auto source = (*session)->client().GetSource(arguments.campaign);
    if (!source.ok()) return Fail(source.status());
    const auto campaign = client::LoadCampaign((*session)->client(), *source);
    if (!campaign.ok()) return Fail(campaign.status());
    std::cout << report::PosteriorJson(*posterior, campaign->parameters);
  } else {
    std::cout << PosteriorText(*posterior,
                               {posterior->warnings().begin(), posterior->warnings().end()});
  }
  return kDone;
}

}  // namespace calib::ctl
