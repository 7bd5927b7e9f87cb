#pragma once
// Emulator of the runs of one model: each coordinate by polynomials and a Gaussian process, which
// weigh as they predict runs that they have not seen.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/adaptive/adaptive_runs.h"
#include "inference/diagnosis/feature_emulator.h"
#include "inference/diagnosis/specimen_likelihood.h"
#include "inference/numerics/gaussian_process.h"

namespace calib::inference {

/// How well runs are predicted that are left out, over the `relevant` ones: the half (20 at least)
/// that is predicted to lie nearest to the readings.
struct ResponseQuality {
  Eigen::Index complete = 0;  ///< runs that it learned from without early ends
  Eigen::Index early = 0;     ///< early ends that were completed
  /// Largest part of a coordinate's variance over runs without repeats that is predicted, (-inf,
  /// 1].
  double explained = 0;
  /// Mean square of errors over the claimed variances before these were widened; 1: as claimed.
  double calibration = 1;
  double mean_square = 0;  ///< of their errors, mean over coordinates
  /// Variance that single runs are emulated to scatter by over what repeats of the same parameters
  /// differ by, mean over coordinates; 0: no repeats.
  double over_repeats = 0;
  double errors_over_repeats = 0;  ///< mean_square likewise
  double repeats_chance = 1;       ///< of as large a ratio or a larger, by Fisher's law
};

/// Coordinates are turned and scaled such that noise and scatter are diagonal there and their sum
/// is one (the scatter as a first polynomial leaves it, shrunk). In each of these FeatureEmulators
/// of degree 0 to 4 and a GaussianProcess stand for the model, all with a departure of each
/// packing, as one normal law of the moments of their mixture: what they differ by is not known.
/// They weigh by the log density of relevant runs left out, whose sum over other such runs is as
/// uncertain as the Bayesian bootstrap says (pseudo-BMA+, Yao et al. 2018, Bayesian Anal. 13,
/// sec. 3.4); of two that predict alike neither wins by a run. Variances are widened by the mean
/// square standardised error of these runs where it exceeds one. Early ends are completed by draws
/// given the coordinates they came to (CompletedRuns). Inputs are standardised coordinates of the
/// prior. Immutable; thread safety: const.
class ResponseEmulator {
 public:
  /// Deterministic in seed. in: what Validate accepts. Errors: FAILED_PRECONDITION for fewer
  /// complete runs than LeastRuns(d), or where nothing can be fitted.
  static absl::StatusOr<ResponseEmulator> Fit(const AdaptiveProblem& problem,
                                              const AdaptiveRuns& runs, std::uint64_t seed);
  /// Complete runs that a model of d parameters takes: a slope each, a mean, and ten to judge by.
  static Eigen::Index LeastRuns(Eigen::Index parameters) { return parameters + 11; }

  Eigen::Index coordinates() const { return measured_.size(); }  ///< q
  const Eigen::VectorXd& measured() const { return measured_; }  ///< q, turned
  const SpecimenErrors& errors() const { return errors_; }       ///< turned
  const ResponseQuality& quality() const { return quality_; }
  /// Degrees of freedom from which the scatter of a specimen is known, runs and packings together;
  /// infinite where there is none.
  double scatter_freedom() const { return scatter_freedom_; }
  /// ln of the volume by which turning scales a density: to be added to one of turned coordinates.
  double log_jacobian() const { return log_jacobian_; }
  /// Turned coordinates of complete runs, n x q.
  Eigen::MatrixXd Turned(const Eigen::MatrixXd& coordinates) const {
    return (coordinates.rowwise() - mean_) * turn_.transpose();
  }

  /// At m standardised points; the variance is that of the mean over packings.
  EmulatorPrediction Predict(const Eigen::MatrixXd& standard) const;
  /// Of each coordinate covariances of what is not known at the rows of a with the same at b.
  std::vector<Eigen::MatrixXd> Covariances(const Eigen::MatrixXd& a,
                                           const Eigen::MatrixXd& b) const;
  /// q x (degrees + 1): of each coordinate the weights of polynomials by degree, then of a process;
  /// of sum one.
  const Eigen::MatrixXd& weights() const { return weights_; }

 private:
  /// What the polynomials and the processes that count predict.
  struct Parts {
    std::vector<std::optional<EmulatorPrediction>> polynomials;       // by degree
    std::vector<std::optional<GaussianProcessPrediction>> processes;  // by coordinate
  };
  Parts PredictParts(const Eigen::MatrixXd& standard) const;
  /// m x (degrees + 1): means of the parts of coordinate k; zeros for those of no weight.
  Eigen::MatrixXd MeansOf(const Parts& parts, Eigen::Index k, Eigen::Index points) const;
  void Weigh(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& outputs,
             const std::vector<int>& packing);
  void CompareWithRepeats(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& outputs);

  Eigen::RowVectorXd mean_;  // q
  Eigen::MatrixXd turn_;     // q x q
  double log_jacobian_ = 0;
  Eigen::VectorXd measured_;
  SpecimenErrors errors_;
  double scatter_freedom_ = 0;
  std::vector<FeatureEmulator> polynomials_;  // by degree
  std::vector<std::optional<GaussianProcess>> processes_;
  Eigen::MatrixXd weights_;   // q x (degrees + 1)
  Eigen::VectorXd widening_;  // q
  ResponseQuality quality_;
};

}  // namespace calib::inference
