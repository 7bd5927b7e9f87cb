#pragma once
// The design of a diagnosis on a server: submitted once, grown batch by batch, found again by its
// text.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "dem/registry/catalog.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/design_stages.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// An answer, and the campaign that its runs are in.
struct DesignedAnswer {
  Answer answer{};
  std::shared_ptr<DesignChain> chain{};  ///< that has answered
  std::string campaign{};                ///< id of the design; empty: it has no runs
  /// Of the parameters that the design has beside those of the base: ranges, SI.
  std::map<std::string, dem::DefaultPrior> parameters{};
};

/// Asks the chain of the base campaign with runs of the laboratory; other: id of another campaign's
/// design, whose runs take the place of scout and main stage, empty: none. Interrupted anywhere and
/// asked again it goes on where it was. Errors: FAILED_PRECONDITION with a sentence where nothing
/// can be asked; RESOURCE_EXHAUSTED where more than most_runs would be needed; those of the runs.
absl::StatusOr<DesignedAnswer> AnswerOnServer(client::Laboratory& laboratory,
                                              const report::CampaignView& base,
                                              DesignQuestion question, const std::string& other,
                                              std::optional<std::int64_t> most_runs);

}  // namespace calib::diagnosis
