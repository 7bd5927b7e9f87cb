#pragma once
// How far apart the parameters come out that are fitted to one packing or another. A likelihood
// whose covariance of the scatter has a wrong form (here: one correlation length per observable,
// none between observables) may be far too sure of them; replicates on several packings, each
// fitted as if it were the measurement, show it without any assumption on that form.

#include <Eigen/Core>

namespace calib::inference {

/// Runs of one parameter vector on R >= 2 packings.
struct Replicates {
  /// R x T, units of the readings: what each run departs by from the mean of all, scaled to the
  /// variance that a measurement has about that mean (ScaledDepartures).
  Eigen::MatrixXd departures;
  /// T x T: the part of the covariance of the readings' errors that stands for such departures.
  Eigen::MatrixXd scatter;
};

/// What R runs depart by from their mean, times sqrt(share + 1/R): the variance that a measurement
/// has about the mean of R runs where it shares that part of a run's scatter. Pure.
/// in: runs R x T, units of the readings; rows that are not finite are left out; share, T,
///     GroupScatter::share of each reading; negative: the packing of its experiment was not varied,
///     no departure
/// out: (finite rows) x T; 0 x T with fewer than two
Eigen::MatrixXd ScaledDepartures(const Eigen::MatrixXd& runs, const Eigen::VectorXd& share);

/// What must be added to the posterior's covariance of the parameters so that they scatter as
/// refits of the replicates do (each fitted as if it were the measurement): for a linear model,
/// likelihood-dominated, the posterior under the covariance scatter + J Spread J^T, J the
/// sensitivity of the histories. That covariance moves in directions only that the parameters
/// absorb: neither misfit nor evidence changes by it. In a known direction refits vary with R - 1
/// degrees of freedom; their variance is taken times the square of Student's over the normal 95 %
/// quantile (R = 4: 2.0, 10: 1.2). With four packings intervals are then too long for some
/// measurements and too short for others, right on average (measured by deploy/bench/coverage).
/// Pure.
/// in: draws S x d of the posterior, in any unit of the parameters; histories S x T, the model's
///     mean predictions of the readings there; covariance T x T of the readings' errors,
///     replicates.scatter included; at least two replicates
/// out: d x d, positive semi-definite; zero, so that nothing is widened, where the covariance of
///      the errors or that of the draws cannot be factorised
Eigen::MatrixXd SpreadOfRefits(const Eigen::MatrixXd& draws, const Eigen::MatrixXd& histories,
                               const Eigen::MatrixXd& covariance, const Replicates& replicates);

}  // namespace calib::inference
