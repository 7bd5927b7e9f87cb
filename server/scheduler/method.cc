#include "server/scheduler/method.h"

#include "calib/return_if_error.h"

namespace calib::scheduler {

std::unique_ptr<Method> MakeMethod(const Definition& definition) {
  switch (definition.campaign.method) {
    case campaign::Method::kTmcmc:
      return MakeTmcmcMethod(definition);
    case campaign::Method::kSurrogateMsrs:
      return MakeSurrogateMethod(definition);
    case campaign::Method::kSqmc:
    case campaign::Method::kIterativeBayesianFilter:
    case campaign::Method::kTable:  // the planner runs their rows and concludes nothing
    case campaign::Method::kDesign:
      break;
  }
  return MakeFilterMethod(definition);
}

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

}  // namespace calib::scheduler
