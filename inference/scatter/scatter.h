#pragma once
// Scatter of the model: what two runs of one parameter vector differ by, because their packings do.
// Strongly correlated along the path, so a covariance and not a number.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "inference/data/data_set.h"

namespace calib::inference {

/// Second moments of a run's departure from the mean history, along the n readings of one
/// observable of one experiment. Units of the readings.
struct ScatterMoments {
  Eigen::VectorXd variance;   ///< n
  Eigen::VectorXd neighbour;  ///< n - 1: covariance of readings i and i + 1
};

/// Of R >= 2 runs (R x n, finite) of one parameter vector on R packings, unbiased (R - 1).
ScatterMoments MomentsOfReplicates(const Eigen::MatrixXd& runs);

/// Clock between neighbours that are as good as independent, in correlation lengths.
inline constexpr double kFarApart = 1e3;

/// Scatter of one observable of one experiment, a Gaussian Markov chain along the path:
/// S_ij = sd_i sd_j exp(-|clock_i - clock_j|).
struct GroupScatter {
  int experiment = 0;
  int observable = 0;
  Eigen::VectorXd sd;     ///< n, >= 0
  Eigen::VectorXd clock;  ///< n, ascending, in correlation lengths
  double length = 0;      ///< of the correlation far from the start, in the control; 0: independent
  /// Part of the variance that the measurement has as well: 1 for a specimen as small as the
  /// model's, grains of the model over grains of the specimen otherwise, [0, 1].
  double share = 1;
};

/// Packings start alike and drift apart: with x the path travelled since the start,
/// v = 1 - (1 - f) exp(-2x / length) is the variance of an Ornstein-Uhlenbeck process that starts
/// with the part f of its final one, and sd_i = s v_i^(p/2), clock_i = x_i / length + ln(v_i) / 2.
/// f = 1 is the stationary process, p = 1 the process as it is, p > 1 a slower start. s is pooled
/// over the readings of each stage; length, f and p are of largest likelihood on a grid (100
/// lengths between a tenth of the closest readings' distance and a hundred times the whole path, f
/// from 1e-4 to 1, p 1 to 3). The likelihood of a zero-mean Markov chain needs no more than
/// neighbours. Deterministic.
/// in: stage, one number per reading (equal within a loading stage); control, n, ascending path
///     length since the start
/// Few replicates know the sd to 1/sqrt(2 (R - 1)) of itself at worst: readings of a stage are no
/// independent witnesses.
GroupScatter FitScatter(const ScatterMoments& moments, const std::vector<int>& stage,
                        const Eigen::VectorXd& control);

/// The covariance of a group's scatter, n x n.
Eigen::MatrixXd ScatterCovariance(const GroupScatter& scatter);

/// The readings with scatter in their errors: Sigma + (runs + share) S per group that has one.
/// runs: 1 where the likelihood of a single run is asked for, 0 for that of the mean history.
/// Groups without scatter keep their errors.
DataSet WithScatter(const DataSet& data, const std::vector<GroupScatter>& scatter, double runs);

}  // namespace calib::inference
