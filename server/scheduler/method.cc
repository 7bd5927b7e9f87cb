#include "server/scheduler/method.h"

namespace calib::scheduler {

std::unique_ptr<Method> MakeMethod(const Definition& definition) {
  switch (definition.campaign.method) {
    case campaign::Method::kTmcmc:
      return MakeTmcmcMethod(definition);
    case campaign::Method::kSurrogateMsrs:
      return MakeSurrogateMethod(definition);
    case campaign::Method::kSqmc:
    case campaign::Method::kIterativeBayesianFilter:
    case campaign::Method::kTable:  // the planner runs its rows and concludes nothing
      break;
  }
  return MakeFilterMethod(definition);
}

absl::StatusOr<std::vector<Eigen::VectorXd>> LogLikelihoodsByBatch(const Definition& definition,
                                                                   const History& history) {
  std::vector<Eigen::VectorXd> batches;
  for (const inference::Iteration& iteration : history.iterations) {
    auto likelihood = inference::LogLikelihood(definition.data, definition.campaign.filter,
                                               iteration.predictions);
    if (!likelihood.ok()) {
      return likelihood.status();
    }
    batches.push_back(*std::move(likelihood));
  }
  return batches;
}

}  // namespace calib::scheduler
