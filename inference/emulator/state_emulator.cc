#include "inference/emulator/state_emulator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

constexpr double kTiny = 1e-300;  // in the place of a zero that is divided by

}  // namespace

using Eigen::Index;

absl::StatusOr<StateEmulator> StateEmulator::Fit(const Eigen::MatrixXd& inputs,
                                                 const Eigen::MatrixXd& histories,
                                                 std::span<const Index> relevant,
                                                 const PrincipalOptions& options) {
  // Rows farther from the readings than any relevant one count in the basis as if they lay at that
  // distance.
  const Eigen::VectorXd distance = histories.rowwise().norm();
  double reach = 0;
  for (const Index i : relevant) reach = std::max(reach, distance[i]);
  const Eigen::VectorXd weights =
      distance.unaryExpr([reach](double value) { return value > reach ? reach / value : 1.0; });

  StateEmulator emulator;
  emulator.components_ = FitPrincipalComponents(histories, weights, relevant, options);
  emulator.scores_ = emulator.components_.Scores(histories);
  if (emulator.scores_.cols() == 0) {
    return absl::FailedPreconditionError(
        "the runs differ in no reading, or by more than numbers can hold beside the stated errors: "
        "there is nothing to emulate.");
  }
  for (Index k = 0; k < emulator.scores_.cols(); ++k) {
    ASSIGN_OR_RETURN(auto process, GaussianProcess::Fit(inputs, emulator.scores_.col(k)));
    emulator.processes_.push_back(std::move(process));
  }
  emulator.CrossValidate(histories, relevant);
  return emulator;
}

void StateEmulator::CrossValidate(const Eigen::MatrixXd& histories,
                                  std::span<const Index> relevant) {
  const auto q = static_cast<Index>(processes_.size());
  const auto m = static_cast<Index>(relevant.size());
  Eigen::MatrixXd error(m, q);
  Eigen::MatrixXd sd(m, q);
  Eigen::MatrixXd outside(m, histories.cols());
  for (Index i = 0; i < m; ++i) {
    const Index row = relevant[static_cast<std::size_t>(i)];
    for (Index k = 0; k < q; ++k) {
      const LeaveOneOut& left_out = processes_[static_cast<std::size_t>(k)].leave_one_out();
      error(i, k) = left_out.error[row];
      sd(i, k) = std::sqrt(left_out.variance[row]);
    }
    outside.row(i) =
        histories.row(row) - components_.mean - scores_.row(row) * components_.basis.transpose();
  }
  const Eigen::MatrixXd standardised = error.cwiseQuotient(sd);
  widening_ = standardised.colwise().squaredNorm().transpose() / static_cast<double>(m);
  cross_validation_.calibration = widening_.mean();
  widening_ = widening_.cwiseMax(1);
  scatter_sd_.resize(q);
  for (Index k = 0; k < q; ++k) {
    scatter_sd_[k] =
        std::sqrt(widening_[k] * processes_[static_cast<std::size_t>(k)].scatter_variance());
  }

  // Shrunk towards independence with the weight of q runs, so that the matrix is definite for any
  // number of runs.
  correlation_ = standardised.transpose() * standardised;
  const Eigen::VectorXd norm = correlation_.diagonal().cwiseSqrt().cwiseMax(kTiny);
  correlation_ = norm.cwiseInverse().asDiagonal() * correlation_ * norm.cwiseInverse().asDiagonal();
  correlation_ *= static_cast<double>(m) / static_cast<double>(m + q);
  correlation_.diagonal().setOnes();

  cross_validation_.error = error * components_.basis.transpose() + outside;
  cross_validation_.standardised.resize(m, histories.cols());
  const Eigen::LLT<Eigen::MatrixXd> factor(correlation_);
  const Eigen::MatrixXd lower = factor.matrixL();
  for (Index i = 0; i < m; ++i) {
    const Eigen::VectorXd claimed = sd.row(i).transpose().cwiseProduct(widening_.cwiseSqrt());
    const Eigen::MatrixXd spread = components_.basis * claimed.asDiagonal() * lower;
    const Eigen::VectorXd variance = spread.rowwise().squaredNorm() + components_.remainder;
    cross_validation_.standardised.row(i) =
        cross_validation_.error.row(i).array() / variance.transpose().array().max(kTiny).sqrt();
  }
  const auto count = static_cast<double>(cross_validation_.error.size());
  cross_validation_.rms = std::sqrt(cross_validation_.error.squaredNorm() / count);
  const double scatter = scatter_sd_.squaredNorm() / static_cast<double>(histories.cols()) +
                         components_.remainder.mean();
  cross_validation_.scatter_rms = std::sqrt(scatter);
}

ScorePrediction StateEmulator::Predict(const Eigen::MatrixXd& inputs) const {
  const auto q = static_cast<Index>(processes_.size());
  ScorePrediction result{.mean = Eigen::MatrixXd(inputs.rows(), q),
                         .sd = Eigen::MatrixXd(inputs.rows(), q)};
  for (Index k = 0; k < q; ++k) {
    const GaussianProcessPrediction one = processes_[static_cast<std::size_t>(k)].Predict(inputs);
    result.mean.col(k) = one.mean;
    result.sd.col(k) = (widening_[k] * one.variance).cwiseSqrt();
  }
  return result;
}

ScorePrediction StateEmulator::PredictLeftOut() const {
  const auto q = static_cast<Index>(processes_.size());
  ScorePrediction result{.mean = scores_, .sd = Eigen::MatrixXd(scores_.rows(), q)};
  for (Index k = 0; k < q; ++k) {
    const GaussianProcess& process = processes_[static_cast<std::size_t>(k)];
    result.mean.col(k) -= process.leave_one_out().error;
    const Eigen::ArrayXd function =
        process.leave_one_out().variance.array() - process.scatter_variance();
    result.sd.col(k) = (widening_[k] * function.max(0)).sqrt();
  }
  return result;
}

}  // namespace calib::inference
