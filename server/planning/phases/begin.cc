#include "server/planning/phases/begin.h"

#include "calib/return_if_error.h"
#include "server/planning/posterior_record.h"

namespace calib::planning {

Batch RowsOfFile(const campaign::Campaign& campaign) {
  const Eigen::MatrixXd& rows = campaign.table->parameters;
  return {.proposal = ProposalToJson({}),
          .parameters = rows,
          .stop_below = std::vector<double>(static_cast<std::size_t>(rows.rows()), store::kUnknown),
          .refused = {}};
}

absl::Status Begin(Step& step, const absl::StatusOr<Batch>& batch) {
  if (!batch.ok()) {
    return step.Fail(batch.status());
  }
  const int iteration = batch->continues ? step.iterations() - 1 : step.iterations();
  const Eigen::Index there =
      batch->continues ? step.history.iterations.back().parameters.rows() : Eigen::Index{0};
  Start start{.iteration = iteration,
              .proposal = batch->proposal,
              .samples = {},
              .continues = batch->continues};
  for (Eigen::Index i = 0; i < batch->parameters.rows(); ++i) {
    const Eigen::VectorXd row = batch->parameters.row(i);
    const auto position = static_cast<std::size_t>(i);
    store::SampleRecord& sample = start.samples.emplace_back(store::SampleRecord{
        .sample = iteration * step.record.submitted.samples + static_cast<int>(there + i),
        .iteration = iteration,
        .parameters = {row.begin(), row.end()},
        .stop_below = batch->stop_below[position],
        .stream = batch->streams.empty() ? std::nullopt : std::optional(batch->streams[position])});
    const bool refused = !batch->refused.empty() && batch->refused[position] != 0;
    if (iteration == 0 && i < GivenRuns(step.campaign())) {
      RETURN_IF_ERROR(
          step.requests().Run(sample, step.definition.ExperimentsOf(campaign::Role::kCalibrate)));
    } else {
      RETURN_IF_ERROR(step.requests().Calibrate(sample, refused));
    }
  }
  step.plan.start = std::move(start);
  return absl::OkStatus();
}

}  // namespace calib::planning
