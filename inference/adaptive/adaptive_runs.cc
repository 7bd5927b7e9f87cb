#include "inference/adaptive/adaptive_runs.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"

namespace calib::inference {

using Eigen::Index;

absl::Status AdaptiveProblem::Validate() const {
  RETURN_IF_ERROR(prior.Validate());
  const Index q = measured.size();
  if (prior.empty()) return absl::InvalidArgumentError("there is no parameter to calibrate");
  if (q == 0 || !measured.allFinite())
    return absl::InvalidArgumentError("measured coordinates are missing or not finite");
  if (noise.rows() != q || noise.cols() != q || !noise.allFinite()) {
    return absl::InvalidArgumentError(absl::StrCat("the noise of ", q, " coordinates is ", q, " x ",
                                                   q, " finite numbers; found ", noise.rows(),
                                                   " x ", noise.cols()));
  }
  if (Eigen::LLT<Eigen::MatrixXd>(noise).info() != Eigen::Success)
    return absl::InvalidArgumentError("the noise of the coordinates is no covariance");
  if (!(share > 0 && share <= 1))
    return absl::InvalidArgumentError(absl::StrCat("share is ", share, "; allowed is (0, 1]"));
  if (packings < 1)
    return absl::InvalidArgumentError(absl::StrCat(packings, " packings; at least 1 is asked for"));
  return absl::OkStatus();
}

AdaptiveRuns AdaptiveRuns::Before(int last) const {
  Index n = 0;
  while (n < rows() && batch[static_cast<std::size_t>(n)] < last) ++n;
  return {.parameters = parameters.topRows(n),
          .packing = {packing.begin(), packing.begin() + n},
          .batch = {batch.begin(), batch.begin() + n},
          .end = {end.begin(), end.begin() + n},
          .coordinates = coordinates.topRows(n)};
}

AdaptiveRuns AdaptiveRuns::Only(const std::vector<Index>& numbers) const {
  AdaptiveRuns result{.parameters = parameters(numbers, Eigen::all),
                      .coordinates = coordinates(numbers, Eigen::all)};
  for (const Index number : numbers) {
    const auto at = static_cast<std::size_t>(number);
    result.packing.push_back(packing[at]);
    result.batch.push_back(batch[at]);
    result.end.push_back(end[at]);
  }
  return result;
}

AdaptiveRuns AdaptiveRuns::Ended() const {
  std::vector<Index> ended;
  for (Index i = 0; i < rows(); ++i) {
    if (end[static_cast<std::size_t>(i)] != RunEnd::kPending) ended.push_back(i);
  }
  return Only(ended);
}

absl::Status AdaptiveRuns::Validate(const AdaptiveProblem& problem) const {
  const Index n = rows();
  const auto count = static_cast<std::size_t>(n);
  if (packing.size() != count || batch.size() != count || end.size() != count)
    return absl::InvalidArgumentError("parameters, packings, batches and ends differ in number");
  if (n == 0) return absl::OkStatus();
  if (parameters.cols() != static_cast<Index>(problem.prior.size()) ||
      coordinates.cols() != problem.measured.size() || coordinates.rows() != n)
    return absl::InvalidArgumentError("parameters or coordinates of the runs do not fit");
  for (Index i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (!problem.prior.InSupport(parameters.row(i).transpose()))
      return absl::InvalidArgumentError(absl::StrCat("run ", i, " lies outside the prior"));
    if (packing[at] < 0 || packing[at] >= problem.packings) {
      return absl::InvalidArgumentError(
          absl::StrCat("run ", i, " is on packing ", packing[at], " of ", problem.packings));
    }
    if (batch[at] < 0 || (i > 0 && batch[at] < batch[at - 1]))
      return absl::InvalidArgumentError("batches of the runs do not ascend from 0");
    if (end[at] == RunEnd::kComplete && !coordinates.row(i).allFinite()) {
      return absl::InvalidArgumentError(
          absl::StrCat("run ", i, " is complete, and not all its coordinates are finite"));
    }
  }
  return absl::OkStatus();
}

Eigen::MatrixXd StandardRows(const JointPrior& prior, const Eigen::MatrixXd& parameters) {
  Eigen::MatrixXd result(parameters.rows(), parameters.cols());
  for (Index i = 0; i < parameters.rows(); ++i)
    result.row(i) = prior.ToStandard(parameters.row(i).transpose()).transpose();
  return result;
}

}  // namespace calib::inference
