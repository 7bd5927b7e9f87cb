#pragma once
// Emulator of the state history: principal components of the runs, a Gaussian process for each of
// their scores.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/emulator/principal_components.h"
#include "inference/numerics/gaussian_process.h"

namespace calib::inference {

/// Scores at some points: the model's mean history there is components().mean + basis * mean, and
/// the covariance of what is not known of it basis * diag(sd) * correlation * diag(sd) * basis^T.
struct ScorePrediction {
  Eigen::MatrixXd mean;  ///< m x q
  Eigen::MatrixXd sd;    ///< m x q, of the mean history, without the scatter of a run
};

/// How well each run is predicted by the others, over the relevant runs; errors in units of the
/// readings' noise sd.
struct CrossValidation {
  Eigen::MatrixXd error;         ///< relevant runs x T: run - prediction from the others
  Eigen::MatrixXd standardised;  ///< the same over the sd that the emulator claims (function,
                                 ///< scatter, remainder)
  double rms = 0;                ///< of `error`
  double scatter_rms = 0;  ///< part of it that the emulator puts down to the scatter of single runs
  double calibration =
      0;  ///< mean square of the scores' standardised errors, 1 when the claims are right
};

class StateEmulator {
 public:
  /// in: inputs n x d, standardised parameters; histories n x T, (prediction - reading) / noise sd;
  ///     relevant: rows that matter for the posterior, on which truncation and errors are judged;
  ///     all finite, n >= 4
  static absl::StatusOr<StateEmulator> Fit(const Eigen::MatrixXd& inputs,
                                           const Eigen::MatrixXd& histories,
                                           std::span<const Eigen::Index> relevant,
                                           const PrincipalOptions& options);

  /// Variances are widened by each component's mean square standardised leave-one-out error where
  /// that exceeds one.
  ScorePrediction Predict(const Eigen::MatrixXd& inputs) const;
  /// Of the training runs, each from all others.
  ScorePrediction PredictLeftOut() const;

  const PrincipalComponents& components() const { return components_; }
  /// Of a single run about the mean history, q, and the correlation of all errors between
  /// components, q x q: that of the leave-one-out errors, since a run that is off is off in every
  /// component at once.
  const Eigen::VectorXd& scatter_sd() const { return scatter_sd_; }
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
