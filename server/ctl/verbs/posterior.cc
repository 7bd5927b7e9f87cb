#include <iostream>
#include <optional>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/documents.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"

namespace calib::ctl {
namespace {

struct PosteriorOptions {
  std::string campaign;
  std::optional<int> iteration{};
};

void Declare(OptionList& list, PosteriorOptions& options) {
  list.Campaign(options.campaign);
  list.WholeNumber("--iteration", options.iteration,
                   "as known after this iteration, from 0 [the last complete one]");
}

absl::StatusOr<int> Posterior(const CommonOptions& common, const PosteriorOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  if (common.json) {
    ASSIGN_OR_RETURN(
        const auto document,
        client::PosteriorDocument(session->client(), options.campaign, options.iteration));
    std::cout << document;
    return kDone;
  }
  ASSIGN_OR_RETURN(const auto posterior,
                   session->client().GetPosterior(options.campaign, options.iteration));
  std::cout << PosteriorText(posterior, {posterior.warnings().begin(), posterior.warnings().end()});
  return kDone;
}

}  // namespace

Verb PosteriorVerb() {
  return MakeVerb<PosteriorOptions>({.name = "posterior",
                                     .description = "Identified parameters with their uncertainty",
                                     .example = "posterior c1 --state calib-state"},
                                    &Declare, &Posterior);
}

}  // namespace calib::ctl
