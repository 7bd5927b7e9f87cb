#include "server/diagnosis/design_run.h"

#include <utility>

#include "calib/return_if_error.h"
#include "server/campaign/file/derive.h"

namespace calib::diagnosis {

absl::StatusOr<DesignedAnswer> AnswerOnServer(client::Laboratory& laboratory,
                                              const report::CampaignView& base,
                                              const DesignQuestion& question) {
  ASSIGN_OR_RETURN(DesignChain chain, DesignChain::Create(base, question));
  ASSIGN_OR_RETURN(const std::string text, campaign::Derive(base.source.campaign_file(),
                                                            DesignOf(base, chain.race())));
  ASSIGN_OR_RETURN(report::CampaignView design,
                   laboratory.Design(base, text, "runs that tell effects apart"));
  DesignedAnswer designed{.answer = {}, .campaign = design.status.campaign()};
  ServerRunMaker maker(laboratory, std::move(design), chain.names());
  ASSIGN_OR_RETURN(designed.answer, AnswerBy(chain, maker));
  return designed;
}

}  // namespace calib::diagnosis
