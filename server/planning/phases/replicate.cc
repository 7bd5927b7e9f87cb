#include "server/planning/phases/replicate.h"

#include <cmath>
#include <limits>
#include <numeric>

#include "calib/return_if_error.h"
#include "server/campaign/model/replicates.h"
#include "server/planning/phases/budget.h"

namespace calib::planning {
namespace {

/// As good as the same parameters, towards the middle of their priors.
Eigen::VectorXd Twin(const Definition& definition, const Eigen::VectorXd& parameters, int number) {
  Eigen::VectorXd moved = parameters;
  for (Eigen::Index j = 0; number > 0 && j < moved.size(); ++j) {
    const inference::Prior& prior = definition.priors[static_cast<std::size_t>(j)];
    const double standard = prior.ToStandard(moved(j));
    moved(j) = prior.FromStandard(standard - std::copysign(kTwinShift * number, standard));
  }
  return moved;
}

}  // namespace

int ReplicatesWanted(Step& step) {
  const int wanted = campaign::ReplicatesOf(step.campaign());
  if (wanted < 2) {
    return 0;
  }
  if (Exceeds(step, static_cast<std::int64_t>(wanted) *
                        static_cast<std::int64_t>(step.campaign().experiments.size()))) {
    step.plan.log.emplace_back("scatter is not measured: it would exceed the budget");
    return 0;
  }
  if (std::string twins = campaign::TwinsInWords(step.campaign()); !twins.empty()) {
    step.plan.log.push_back(std::move(twins));
  }
  return wanted;
}

absl::Status Replicate(Step& step, const Answer& answer, int count) {
  Start start{.iteration = step.iterations(), .proposal = kReplicates, .samples = {}};
  const std::vector<inference::ParameterSummary> parameters = answer.Parameters();
  Eigen::VectorXd best(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    best(static_cast<Eigen::Index>(j)) = parameters[j].mean;
  }
  const bool moved = !campaign::VariesPackings(step.campaign());
  std::vector<int> experiments(step.campaign().experiments.size());
  std::iota(experiments.begin(), experiments.end(), 0);
  for (int i = 0; i < count; ++i) {
    const Eigen::VectorXd own = moved ? Twin(step.definition, best, i) : best;
    start.samples.push_back({.sample = start.iteration * step.record.submitted.samples + i,
                             .iteration = start.iteration,
                             .parameters = {own.begin(), own.end()},
                             .log_weight = -std::numeric_limits<double>::infinity()});
    RETURN_IF_ERROR(step.requests().Run(start.samples.back(), experiments));
  }
  step.plan.draws = std::move(start);
  return absl::OkStatus();
}

bool TwinsShowNothing(const Step& step) {
  return step.replicating && step.scatter.empty() && !campaign::VariesPackings(step.campaign());
}

}  // namespace calib::planning
