#include "server/planning/phases/validate.h"

#include <limits>

#include "calib/return_if_error.h"

namespace calib::planning {
namespace {

/// Some of the draws, as samples of an iteration of their own.
absl::Status ValidateDraws(Step& step, const Eigen::MatrixXd& draws,
                           const std::vector<int>& experiments) {
  Start start{.iteration = step.iterations() + (step.replicating ? 1 : 0),
              .proposal = kHeldOutDraws,
              .samples = {}};
  const Eigen::MatrixXd rows =
      EvenlySpaced(draws, static_cast<std::size_t>(step.campaign().samples));
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Eigen::VectorXd row = rows.row(i);
    start.samples.push_back(
        {.sample = start.iteration * step.record.submitted.samples + static_cast<int>(i),
         .iteration = start.iteration,
         .parameters = {row.begin(), row.end()},
         .log_weight = -std::numeric_limits<double>::infinity()});  // not of the ensemble
    RETURN_IF_ERROR(step.requests().Run(start.samples.back(), experiments));
  }
  step.plan.draws = std::move(start);
  return absl::OkStatus();
}

}  // namespace

absl::Status Validate(Step& step, const Answer& answer) {
  const auto experiments = step.definition.ExperimentsOf(campaign::Role::kValidate);
  if (experiments.empty() || step.campaign().precomputed.has_value()) {
    step.Finish();
    return absl::OkStatus();
  }
  step.plan.phase = campaign::Phase::kValidating;
  if (answer.FromEmulator()) {
    return ValidateDraws(step, answer.emulated->draws, experiments);
  }
  const std::vector<double>& log_weights = step.plan.conclusion->log_weights;
  for (const std::size_t i :
       answer.draws.rows() > 0 ? EvenlyByWeight(log_weights) : Heaviest(log_weights)) {
    RETURN_IF_ERROR(step.requests().Run(step.history.samples[i], experiments));
  }
  return absl::OkStatus();
}

}  // namespace calib::planning
