#pragma once
// What is sampled on an emulator: the parameters that are not held and, where the noise is
// inferred, one coordinate per noise group or model error, over the part of the prior where the
// emulator knows the model.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/emulator/state_emulator.h"
#include "inference/filter/iterative_filter.h"
#include "inference/prior/joint_prior.h"

namespace calib::inference {

/// Standardised coordinates (Prior::ToStandard) of each row of parameters, N x d. Pure.
Eigen::MatrixXd ToStandard(const JointPrior& priors, const Eigen::MatrixXd& parameters);

/// What an emulator says of m points.
struct EmulatedPoints {
  ScorePrediction prediction;  ///< of the emulated histories
  Eigen::MatrixXd noise;       ///< m x groups, as EmulatedLikelihood::LogLikelihood takes it
  /// m: sum over the readings of the variance of what the emulator does not know of the mean
  /// history, in units of the noise variance.
  Eigen::VectorXd unknown;
};

/// The space that is sampled, of points: the free ones of d parameters in their units, then one
/// number z for each noise group with kInferred, one number u for each model error with
/// kModelError. Keeps references to priors and emulator, which outlive it. Immutable; thread
/// safety: const.
class EmulatedTarget {
 public:
  /// The space given an emulator of the data. noise: all but kEssTarget. max_error: largest root
  /// mean square over the readings of what is not known that a point may have, in noise sd.
  /// Parameters that the last iteration holds (Proposal::frozen) are held.
  EmulatedTarget(const JointPrior& priors, const DataSet& data, NoiseMode noise, double max_error,
                 const StateEmulator& emulator, std::span<const Iteration> iterations);

  /// Prior of points: of the free parameters, and of z of each noise group, whose factor is
  /// f = 1 / z^2, z half normal, or the quantile of the factor's prior at Phi(z), z normal, where
  /// that is not inverse gamma of 1/2 and 1/2; of u of each model error, uniform on [0, 1], the
  /// prior probability below its level, in their order.
  const JointPrior& prior() const { return prior_; }
  /// All d parameters of m points, m x d; held ones at their values.
  Eigen::MatrixXd Complete(const Eigen::MatrixXd& points) const;
  /// What the emulator says of m points.
  EmulatedPoints At(const Eigen::MatrixXd& points) const;
  /// The emulated histories of m rows of all d parameters.
  ScorePrediction Predict(const Eigen::MatrixXd& parameters) const;
  /// EmulatedPoints::noise of m points: variance factors, or levels; 0 columns with kGiven.
  Eigen::MatrixXd Noise(const Eigen::MatrixXd& points) const;
  /// EmulatedPoints::unknown of m points with the emulator's sd (m x q) and noise.
  Eigen::VectorXd Unknown(const Eigen::MatrixXd& sd, const Eigen::MatrixXd& noise) const;
  /// What multiplies the stated variances of the T readings for a row of EmulatedPoints::noise.
  Eigen::VectorXd LargerVariances(const Eigen::RowVectorXd& noise) const;
  /// Whether the emulator knows the model at a point with this EmulatedPoints::unknown. False where
  /// no run has been: nothing can be said there, and a model that fits nowhere would otherwise
  /// prefer the corner of which the emulator knows least.
  bool IsKnown(double unknown) const { return unknown <= most_unknown_; }

  /// Indices of the parameters that are not held, ascending.
  const std::vector<Eigen::Index>& free() const { return free_; }
  /// The value that parameter j is held at; nullopt: it is free.
  std::optional<double> Held(Eigen::Index j) const;
  /// The cells of the data's model errors; none but with kModelError.
  const std::vector<ErrorCells>& cells() const { return cells_; }

 private:
  void AddSharesAtLevels(const PrincipalComponents& components);
  // What multiplies the stated variance of a reading of a model error at one of its levels.
  double LargerVariance(std::size_t reading, Eigen::Index level) const;
  bool AnyHeld() const { return static_cast<Eigen::Index>(free_.size()) < held_.size(); }

  const JointPrior& priors_;
  const StateEmulator& emulator_;
  std::vector<Eigen::Index> free_;
  Eigen::RowVectorXd held_;  // d, those of the free ones overwritten
  JointPrior prior_;
  std::vector<NoiseGroup> groups_;          // kInferred alone
  std::vector<ErrorCells> cells_;           // kModelError alone, of the model errors
  std::vector<std::vector<double>> below_;  // prior probability up to the end of each level
  std::vector<Eigen::Index>
      group_;  // of each reading: noise group, model error, -1: none; or empty
  std::vector<double> values_, sds_;  // of the readings; with kModelError alone
  // groups x q: squares of the basis, summed over the group's readings; the last of kModelError are
  // those of no group.
  Eigen::MatrixXd shares_;
  // kModelError: for each group levels x q, the same over what multiplies the stated variances.
  std::vector<Eigen::MatrixXd> shares_at_level_;
  double most_unknown_ = 0;
};

}  // namespace calib::inference
