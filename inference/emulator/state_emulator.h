#pragma once
// Emulator of the histories of runs, a history being the predictions of all T readings: principal
// components of the runs, a Gaussian process for each of their scores.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/emulator/principal_components.h"
#include "inference/numerics/gaussian_process.h"

namespace calib::inference {

/// Scores of an emulator of q components at m points: the model's mean history at a point is
/// components().mean + basis * mean, and the covariance of what is not known of it
/// basis * diag(sd) * correlation() * diag(sd) * basis^T.
struct ScorePrediction {
  Eigen::MatrixXd mean;  ///< m x q
  Eigen::MatrixXd sd;    ///< m x q, of the mean history, without the scatter of a run
};

/// How well each run is predicted from the others, over the relevant runs, those that matter for
/// the posterior; errors in units of the readings' noise sd.
struct CrossValidation {
  Eigen::MatrixXd error;  ///< relevant runs x T: run - prediction from the others
  /// Relevant runs x T: `error` over the sd that the emulator claims (of the function, the scatter
  /// of a run and the remainder).
  Eigen::MatrixXd standardised;
  double rms = 0;          ///< root mean square of `error`
  double scatter_rms = 0;  ///< part of `rms` that the emulator puts down to scatter of single runs
  /// Mean square of the scores' standardised errors, 1 when the emulator's claims are right.
  double calibration = 0;
};

/// An emulator of histories. A value; immutable after Fit. Thread safety: const.
class StateEmulator {
 public:
  /// Learns from n >= 4 runs. Deterministic.
  /// in: inputs n x d, standardised parameters; histories n x T, (prediction - reading) / noise sd;
  ///     relevant, the rows that matter for the posterior, on which truncation and errors are
  ///     judged; all finite
  /// Errors: FAILED_PRECONDITION when the runs differ in no reading, or a process cannot be fitted.
  static absl::StatusOr<StateEmulator> Fit(const Eigen::MatrixXd& inputs,
                                           const Eigen::MatrixXd& histories,
                                           std::span<const Eigen::Index> relevant,
                                           const PrincipalOptions& options);

  /// Scores at the rows of an m x d matrix of standardised parameters. Variances are widened by
  /// each component's mean square standardised leave-one-out error where that exceeds one.
  ScorePrediction Predict(const Eigen::MatrixXd& inputs) const;
  /// Scores of the n training runs, each predicted from all others.
  ScorePrediction PredictLeftOut() const;

  const PrincipalComponents& components() const { return components_; }
  /// Standard deviation of a single run's scores about those of the mean history, q entries.
  const Eigen::VectorXd& scatter_sd() const { return scatter_sd_; }
  /// Correlation of all errors between components, q x q: that of the leave-one-out errors, since a
  /// run that is off is off in every component at once.
  const Eigen::MatrixXd& correlation() const { return correlation_; }
  const CrossValidation& cross_validation() const { return cross_validation_; }

 private:
  void CrossValidate(const Eigen::MatrixXd& histories, std::span<const Eigen::Index> relevant);

  PrincipalComponents components_;
  std::vector<GaussianProcess> processes_;
  Eigen::MatrixXd scores_;
  Eigen::VectorXd widening_;  // of the variances, q, >= 1
  Eigen::VectorXd scatter_sd_;
  Eigen::MatrixXd correlation_;
  CrossValidation cross_validation_;
};

}  // namespace calib::inference
