#pragma once
// Posteriors and proposals as the store keeps them: JSON whose doubles come back bit for bit.

#include <string>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "inference/filter/iterative_filter.h"
#include "server/planning/answer.h"
#include "server/planning/definition.h"

namespace calib::planning {

/// The message for users; counts of effort are left to whoever knows them.
v1::Posterior ToMessage(const Definition& definition, const Answer& answer, int iteration,
                        bool converged);

std::string PosteriorToJson(const v1::Posterior& posterior);
/// DATA_LOSS when the text is not what PosteriorToJson() wrote.
absl::StatusOr<v1::Posterior> PosteriorFromJson(const std::string& json);

std::string ProposalToJson(const inference::Proposal& proposal);
absl::StatusOr<inference::Proposal> ProposalFromJson(const std::string& json);

/// The part of an earlier posterior that convergence looks at: the means.
inference::Posterior MeansOf(const v1::Posterior& posterior);

}  // namespace calib::planning
