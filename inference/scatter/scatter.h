#pragma once
// Scatter of the model: what two runs of one parameter vector differ by, because their packings do.
// Strongly correlated along the loading path, so a covariance and not a number. Pure functions.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "inference/data/data_set.h"

namespace calib::inference {

/// Second moments of a run's departure from the mean over packings, along the n readings of one
/// observable of one experiment, in the square of their unit.
struct ScatterMoments {
  Eigen::VectorXd variance;   ///< n
  Eigen::VectorXd neighbour;  ///< n - 1: covariance of readings i and i + 1
};

/// Moments of the departures of R >= 2 runs of one parameter vector on R packings, unbiased
/// (divisor R - 1). runs: R x n, finite.
ScatterMoments MomentsOfReplicates(const Eigen::MatrixXd& runs);

/// Least departure, in sd of a reading's noise, by which runs of nearly the same parameters count
/// as different ones: far above what rounding leaves in a smooth model, far below what matters.
inline constexpr double kParted = 1e-6;

/// Whether R >= 2 twins have become runs of their own: run k has its parameters moved by number_k
/// times a small step, so that those of a smooth model lie on a straight line over `number`. The
/// largest root mean square about it, over the readings, is at least kParted of their noise sd; two
/// runs are held to their mean. Pure.
/// in: runs R x n, finite; number, R different ones; noise, n sd > 0
bool HaveParted(const Eigen::MatrixXd& runs, const Eigen::VectorXd& number,
                const Eigen::VectorXd& noise);

/// Clock between neighbours that are taken for independent, in correlation lengths: exp(-1000) is
/// zero in double.
inline constexpr double kFarApart = 1e3;

/// Scatter of the n readings of one observable of one experiment, a Gaussian Markov chain along the
/// path with the covariance S_ij = sd_i sd_j exp(-|clock_i - clock_j|).
struct GroupScatter {
  int experiment = 0;
  int observable = 0;
  Eigen::VectorXd sd;     ///< n, >= 0, units of the readings
  Eigen::VectorXd clock;  ///< n, ascending, in correlation lengths
  double length = 0;      ///< of the correlation far from the start, in the control; 0: independent
  /// Part of the scatter's variance that the measurement has as well, [0, 1]: 1 for a specimen as
  /// small as the model's, grains of the model over grains of the specimen otherwise.
  double share = 1;
};

/// Fits the chain of GroupScatter to the moments of R runs. Packings start alike and drift apart:
/// with x the path travelled since the start, v = 1 - (1 - f) exp(-2x / length) is the variance of
/// an Ornstein-Uhlenbeck process that starts with the part f of its final one, and sd_i = s
/// v_i^(p/2), clock_i = x_i / length + ln(v_i) / 2. f = 1 is the stationary process, p = 1 the
/// process as it is, p > 1 a slower start. s is pooled over the readings of each stage; length, f
/// and p are of largest likelihood on a grid (100 lengths between a tenth of the closest readings'
/// distance and a hundred times the whole path, f from 1e-4 to 1, p 1 to 3). The likelihood of a
/// zero-mean Markov chain needs no more than neighbours. The sd is known to 1/sqrt(2 (R - 1)) of
/// itself at worst: readings of a stage are no independent witnesses.
/// in: stage, n numbers, equal for readings of one loading stage; control, n, ascending path length
///     since the start
GroupScatter FitScatter(const ScatterMoments& moments, const std::vector<int>& stage,
                        const Eigen::VectorXd& control);

/// The covariance S of a group's scatter, n x n, in the square of the readings' unit.
Eigen::MatrixXd ScatterCovariance(const GroupScatter& scatter);

/// The data with scatter in the readings' errors: the covariance of each (experiment, observable)
/// that `scatter` names grows by (runs + share) S. runs: 1 for errors about a single run, 0 for
/// errors about the mean over packings.
DataSet WithScatter(const DataSet& data, const std::vector<GroupScatter>& scatter, double runs);

}  // namespace calib::inference
