#include "inference/emulator/stopped_runs.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kLeastRemainder =
    1e-6;  // variance of a reading outside the basis, of the noise's;
           // chosen: what is exactly in the basis can be solved for

// What is known of the scores of one run: mean + root * z, z standard normal.
struct Scores {
  Eigen::VectorXd mean;
  Eigen::MatrixXd root;
};

Scores Given(const Eigen::RowVectorXd& history, const std::vector<Index>& seen,
             const StateEmulator& emulator, const ScorePrediction& prediction, Index row) {
  const PrincipalComponents& components = emulator.components();
  const Eigen::VectorXd spread =
      (prediction.sd.row(row).transpose().array().square() + emulator.scatter_sd().array().square())
          .sqrt();
  const Eigen::MatrixXd correlation = Eigen::LLT<Eigen::MatrixXd>(emulator.correlation()).matrixL();
  const Eigen::MatrixXd prior = spread.asDiagonal() * correlation;  // D chol(C)
  const auto q = static_cast<Index>(spread.size());
  Eigen::MatrixXd precision = Eigen::MatrixXd::Identity(q, q);
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(q);
  for (const Index t : seen) {
    const Eigen::VectorXd along = prior.transpose() * components.basis.row(t).transpose();
    const double variance = std::max(components.remainder[t], kLeastRemainder);
    const double off =
        history[t] - components.mean[t] - components.basis.row(t).dot(prediction.mean.row(row));
    precision += along * along.transpose() / variance;
    pull += along * (off / variance);
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(precision);
  return {.mean = prediction.mean.row(row).transpose() + prior * factor.solve(pull),
          .root = prior * factor.matrixU().solve(Eigen::MatrixXd::Identity(q, q))};
}

}  // namespace

Runs CompletedRuns(const Runs& finished, const Runs& stopped, const StateEmulator& emulator,
                   const CompletionOptions& options) {
  const PrincipalComponents& components = emulator.components();
  const ScorePrediction prediction = emulator.Predict(stopped.inputs);
  Runs all{.inputs = Eigen::MatrixXd(finished.inputs.rows() + stopped.inputs.rows(),
                                     finished.inputs.cols()),
           .histories = Eigen::MatrixXd(finished.inputs.rows() + stopped.inputs.rows(),
                                        finished.histories.cols())};
  all.inputs.topRows(finished.inputs.rows()) = finished.inputs;
  all.histories.topRows(finished.inputs.rows()) = finished.histories;
  Index used = finished.inputs.rows();
  for (Index i = 0; i < stopped.inputs.rows(); ++i) {
    std::vector<Index> seen;
    std::vector<Index> lacking;
    for (Index t = 0; t < stopped.histories.cols(); ++t) {
      (std::isfinite(stopped.histories(i, t)) ? seen : lacking).push_back(t);
    }
    if (seen.empty() || lacking.empty()) continue;
    const Scores scores = Given(stopped.histories.row(i), seen, emulator, prediction, i);
    const double unknown = (components.basis(lacking, Eigen::all) * scores.root).squaredNorm() /
                           static_cast<double>(lacking.size());
    if (!(std::sqrt(unknown) <= options.max_unknown)) continue;
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kStoppedRuns,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(i)});
    Eigen::VectorXd normal(scores.mean.size());
    for (double& z : normal) z = stream.Normal();
    const Eigen::VectorXd drawn = scores.mean + scores.root * normal;
    all.inputs.row(used) = stopped.inputs.row(i);
    all.histories.row(used) = stopped.histories.row(i);
    for (const Index t : lacking) {
      all.histories(used, t) = components.mean[t] + components.basis.row(t).dot(drawn) +
                               std::sqrt(components.remainder[t]) * stream.Normal();
    }
    ++used;
  }
  all.inputs.conservativeResize(used, Eigen::NoChange);
  all.histories.conservativeResize(used, Eigen::NoChange);
  return all;
}

absl::StatusOr<TrainedEmulator> TrainWithStopped(const Runs& finished, const Runs& stopped,
                                                 const DataSet& data,
                                                 const TrainingOptions& training,
                                                 const CompletionOptions& completion) {
  constexpr int kRounds = 2;
  ASSIGN_OR_RETURN(auto trained, TrainEmulator(finished, data, training));
  for (int round = 0; round < kRounds && stopped.inputs.rows() > 0; ++round) {
    auto again = TrainEmulator(CompletedRuns(finished, stopped, trained.emulator, completion), data,
                               training);
    if (!again.ok()) break;
    trained = *std::move(again);
  }
  return trained;
}

}  // namespace calib::inference
