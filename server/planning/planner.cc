#include "server/planning/planner.h"

#include "calib/return_if_error.h"

namespace calib::planning {

absl::StatusOr<std::vector<Eigen::VectorXd>> LogLikelihoodsByBatch(const Definition& definition,
                                                                   const History& history,
                                                                   std::size_t first) {
  std::vector<Eigen::VectorXd> batches;
  for (std::size_t k = first; k < history.iterations.size(); ++k) {
    ASSIGN_OR_RETURN(auto likelihood,
                     inference::LogLikelihood(definition.data, definition.campaign.filter,
                                              history.iterations[k].predictions));
    batches.push_back(std::move(likelihood));
  }
  return batches;
}

}  // namespace calib::planning
