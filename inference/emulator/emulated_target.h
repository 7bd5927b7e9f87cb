#pragma once
// What is sampled on an emulator: the parameters that are not held and, where the noise is inferred,
// one coordinate per noise group, over the part of the prior where the emulator knows the model.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/emulator/state_emulator.h"
#include "inference/filter/iterative_filter.h"
#include "inference/prior/joint_prior.h"

namespace calib::inference {

/// Standardised coordinates of each row of parameters, N x d.
Eigen::MatrixXd ToStandard(const JointPrior& priors, const Eigen::MatrixXd& parameters);

/// Some points, their emulated histories and the variance factors they stand for.
struct EmulatedPoints {
  ScorePrediction prediction;
  Eigen::MatrixXd factors;  ///< of the noise variance, m x groups; 0 columns: as stated
  /// Sum over the readings of the variance of what the emulator does not know of the mean history
  /// there, in units of the noise variance; m.
  Eigen::VectorXd unknown;
};

/// Keeps references to priors and emulator.
class EmulatedTarget {
 public:
  /// noise: kGiven or kInferred. max_error: largest root mean square of what is not known that a
  /// point may have, in noise sd. Parameters that the last iteration holds (Proposal::frozen) are
  /// held.
  EmulatedTarget(const JointPrior& priors, const DataSet& data, NoiseMode noise, double max_error,
                 const StateEmulator& emulator, std::span<const Iteration> iterations);

  /// The free parameters, then z of each noise group: f = 1 / z^2, z half normal, or the quantile
  /// of the factor's prior at Phi(z) where that is not inverse gamma of 1/2 and 1/2.
  const JointPrior& prior() const { return prior_; }
  /// All d parameters of sampled points; held ones at their values.
  Eigen::MatrixXd Complete(const Eigen::MatrixXd& points) const;
  EmulatedPoints At(const Eigen::MatrixXd& points) const;
  ScorePrediction Predict(const Eigen::MatrixXd& parameters) const;
  Eigen::MatrixXd Factors(const Eigen::MatrixXd& points) const;
  Eigen::VectorXd Unknown(const Eigen::MatrixXd& sd, const Eigen::MatrixXd& factors) const;
  /// False where no run has been: nothing can be said there, and a model that fits nowhere would
  /// otherwise prefer the corner of which the emulator knows least.
  bool IsKnown(double unknown) const { return unknown <= most_unknown_; }

  const std::vector<Eigen::Index>& free() const { return free_; }
  std::optional<double> Held(Eigen::Index j) const;
  /// Noise group of each reading; empty with kGiven.
  const std::vector<Eigen::Index>& group() const { return group_; }

 private:
  bool AnyHeld() const { return static_cast<Eigen::Index>(free_.size()) < held_.size(); }

  const JointPrior& priors_;
  const StateEmulator& emulator_;
  std::vector<Eigen::Index> free_;
  Eigen::RowVectorXd held_;  // d, those of the free ones overwritten
  JointPrior prior_;
  std::vector<NoiseGroup> groups_;
  std::vector<Eigen::Index> group_;
  Eigen::MatrixXd shares_;  // groups x q: squares of the basis, summed over the group's readings
  double most_unknown_ = 0;
};

}  // namespace calib::inference
