#pragma once
// The design of a diagnosis on a server: submitted once, grown batch by batch, found again by its
// text.

#include <string>

#include "absl/status/statusor.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/design_stages.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// An answer, and the campaign that its runs are in.
struct DesignedAnswer {
  Answer answer{};
  std::string campaign{};  ///< id of the design
};

/// Asks the chain of the base campaign with runs of the laboratory. Interrupted anywhere and asked
/// again it goes on where it was. Errors: FAILED_PRECONDITION with a sentence where nothing can be
/// asked; those of the runs.
absl::StatusOr<DesignedAnswer> AnswerOnServer(client::Laboratory& laboratory,
                                              const report::CampaignView& base,
                                              const DesignQuestion& question);

}  // namespace calib::diagnosis
