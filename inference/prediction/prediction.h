#pragma once
// A quantity predicted from runs at draws of the posterior [Hadjidoukas 2014, Eqs. 11-15]. Pure
// functions.

#include <Eigen/Core>

#include "absl/status/statusor.h"

namespace calib::inference {

/// Prediction of T quantities Q from N runs: Q | theta ~ N(mu(theta), model_sd^2 + error_sd^2),
/// theta from its posterior. All in the quantities' units.
struct QuantityPrediction {
  Eigen::VectorXd mean;           ///< T, posterior mean of mu                              [Eq. 14]
  Eigen::VectorXd sd;             ///< T, of Q: both parts and the error of a reading       [Eq. 15]
  Eigen::VectorXd sd_parameters;  ///< T, of mu over the posterior; NaN where not separated
  Eigen::VectorXd sd_model;       ///< T, of a run about mu; NaN where not separated
  /// T, 5, 50 and 95 % quantiles of Q, from the mixture over draws [Eq. 12], stretched about the
  /// median by what is not known of the mean and the scatter of so few runs (Student's t).
  Eigen::VectorXd q05, q50, q95;
  /// False: too few runs (fewer than d + 4) to tell the two parts apart; sd holds both.
  bool separated = false;
  double freedom = 1;  ///< degrees of freedom from which the scatter is known

  Eigen::MatrixXd conditional_mean;  ///< N x T: mu at each draw
  Eigen::VectorXd conditional_sd;    ///< T: of Q at a draw
};

/// Predicts quantities from runs at equally weighted draws of a posterior. A run is one draw's
/// history on one packing: mu(theta) + scatter. Over a posterior mu is nearly linear in the
/// parameters, so that a linear regression on them tells its variance from that of the scatter
/// (residual variance, unbiased; the noise that the fit picks up is taken off the parameters'
/// part).
/// in: parameters N x d, on any linear scale (the prior's standardised one, say); runs N x T;
///     error_sd T, >= 0, of a reading that would be taken (0: prediction of the model alone); N >=
///     2, all finite; scatters: false where a run is a function of its parameters alone (no packing
///     whose place chance decides): all that runs differ by is theirs, however curved mu is
/// Errors: INVALID_ARGUMENT naming what does not fit.
absl::StatusOr<QuantityPrediction> PredictQuantity(const Eigen::MatrixXd& parameters,
                                                   const Eigen::MatrixXd& runs,
                                                   const Eigen::VectorXd& error_sd,
                                                   bool scatters = true);

/// The prediction with a further error of the model of standard deviation sd (T, >= 0),
/// independent of scatter and parameters: it joins sd_model, sd and the quantiles, not the mean.
QuantityPrediction WithModelError(QuantityPrediction prediction, const Eigen::VectorXd& sd);

/// Pr(Q_t >= level) for each of the T quantities by the stretched law that the prediction's
/// quantiles are of, so that Pr(Q_t >= q95_t) = 0.05.
///                                                                  [Hadjidoukas 2014, Eqs. 11, 12]
Eigen::VectorXd ExceedanceProbability(const QuantityPrediction& prediction, double level);

/// Quantile of probability p, in (0, 1), of each of the T quantities by that same law: at 0.05, 0.5
/// and 0.95 the prediction's own.
Eigen::VectorXd QuantileOf(const QuantityPrediction& prediction, double p);

/// What Pr(Q_t >= level) would be by one part of what is uncertain alone.
struct ExceedanceParts {
  Eigen::VectorXd parameters;  ///< T, share of the posterior draws whose mu reaches the level
  Eigen::VectorXd model;  ///< T, normal tail of the model's error about the posterior mean of mu
};
/// NaN where the two parts are not separated.                                [Hadjidoukas 2014, Eq. 15]
ExceedanceParts PartsOfExceedance(const QuantityPrediction& prediction, double level);

/// Pr(Q_t >= level for some t) of T quantities along a history: a run's, its departure from the
/// mean stretched as the quantiles are, plus an error of the model that is off to one side all
/// along and errors of readings that know nothing of each other. Never less than the largest
/// ExceedanceProbability.
/// in: runs N x T, those of the prediction; shared_sd T, >= 0, of the model's error; error_sd T, >=
///     0, of the readings' errors
double ExceedanceAnywhere(const QuantityPrediction& prediction, const Eigen::MatrixXd& runs,
                          const Eigen::VectorXd& shared_sd, const Eigen::VectorXd& error_sd,
                          double level);

}  // namespace calib::inference
