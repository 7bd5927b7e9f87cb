#pragma once
// Emulator of runs with few effects on: Bayesian linear features of each coordinate, all
// coordinates and all models of the diagnosis in one fit.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/design_runs.h"
#include "inference/diagnosis/effect_features.h"

namespace calib::inference {

/// What an emulator learns from. Outputs are in units in which runs scatter by about one.
struct EmulatorData {
  DesignPoints points{};       ///< N
  std::vector<int> packing{};  ///< N numbers of any value, equal for runs on one packing
  Eigen::MatrixXd outputs{};   ///< N x q
  /// Differences of calculated effects, D x q of outputs: known but for the features' own error.
  CalculatedDifferences differences{};
};

/// By how much more runs scatter, or are missed, with effects on: variance times
/// 1 + single sum_k f_k^2 + pair sum_(k<l) f_k^2 f_l^2.
struct RunVariance {
  double single = 0;  ///< kappa1 >= 0
  double pair = 0;    ///< kappa2 >= 0
};

/// Variances of an emulator.
struct EmulatorVariances {
  Eigen::VectorXd group{};  ///< prior variance of the coefficients of each EffectFeatures::groups()
  double packing = 0.2;     ///< prior variance of a packing's departure, all coordinates
  Eigen::VectorXd run{};    ///< q: variance of a run about its packing's mean
};

/// How FeatureEmulator::Fit goes about it.
struct FeatureEmulatorOptions {
  RunVariance run_variance{};
  std::optional<EmulatorVariances> start{};  ///< of an emulator of nearly the same runs
  bool hold = false;                         ///< take `start` as it is
  int max_iterations = 60;                   ///< of the variances, >= 1
  double tolerance = 1e-3;  ///< largest change of the logarithm of a run variance at the end
};

/// What an emulator says of m points.
struct EmulatorPrediction {
  Eigen::MatrixXd mean{};      ///< m x q
  Eigen::MatrixXd variance{};  ///< m x q, of the mean over packings: what is not known of it
  /// m: what RunVariance adds to 1 there.
  Eigen::VectorXd added_run_variance{};
};

/// Each of the N runs predicted from all others, hyper-parameters held; its packing is known where
/// others are on it.
struct LeftOutRuns {
  Eigen::MatrixXd error{};     ///< N x q: run minus prediction
  Eigen::MatrixXd variance{};  ///< N x q, of `error`
  double log_density = 0;      ///< sum over runs and coordinates of the normal log density
};

/// output = features b + packing + run,  b_i ~ N(0, tau of its group),  packing ~ N(0, tau_p),
/// run ~ N(0, sigma^2 (1 + kappa terms)), per coordinate; tau is shared by all coordinates, so that
/// each effect's size is known from q numbers per feature. tau and sigma^2 are at the fixed point
///   tau = (sum b^2 + sum var b + 4 tau0) / (n + 4),  sigma^2 = sum w r^2 / (N - freedom used)
/// of EM with a weak inverse-gamma prior about tau0, and of the evidence's maximum.
///                    [MacKay, Neural Comput. 4 (1992) 415, Eqs. 2.16-2.18; Tipping 2001, sec. 2.2]
/// Constant and slopes are not shrunk. In coordinates in which the prior is white one
/// eigen-decomposition X^T W X = U D U^T serves all coordinates. Immutable; thread safety: const.
class FeatureEmulator {
 public:
  /// Deterministic. Errors: INVALID_ARGUMENT for sizes that do not fit or numbers that are not
  /// finite; FAILED_PRECONDITION for an effect that is on in fewer than two runs or differences, or
  /// fewer runs than base features and ten.
  static absl::StatusOr<FeatureEmulator> Fit(const EffectFeatures& features,
                                             const EmulatorData& data,
                                             const FeatureEmulatorOptions& options = {});

  const EffectFeatures& features() const { return features_; }
  Eigen::Index coordinates() const { return coefficients_.cols(); }  ///< q
  const EmulatorVariances& variances() const { return variances_; }
  const RunVariance& run_variance() const { return run_variance_; }
  /// q: variance of a run on a packing of its own about the mean over packings: run and packing.
  const Eigen::VectorXd& specimen() const { return specimen_; }
  /// Degrees of freedom of `specimen`, from those of runs and packings, mean over coordinates.
  ///                                         [Satterthwaite, Biometrics Bull. 2 (1946) 110, Eq. 17]
  double freedom() const { return freedom_; }
  /// Degrees of freedom that the features have used, mean over coordinates: how many coefficients
  /// the
  /// runs determine, sum_i (1 - posterior / prior variance).               [MacKay 1992, Eq. 2.19]
  double used() const { return used_; }
  /// N x q: runs minus means over packings, over sqrt(1 + kappa terms).
  const Eigen::MatrixXd& residuals() const { return residuals_; }
  const LeftOutRuns& left_out() const { return left_out_; }
  int iterations() const { return iterations_; }  ///< of the variances

  /// At m points, which fit the features. An effect of strength 0 changes no bit.
  EmulatorPrediction Predict(const DesignPoints& points) const;
  /// Means alone, the bits of Predict().mean; m x q.
  Eigen::MatrixXd PredictMean(const DesignPoints& points) const;
  /// Derivative of the base part by base parameter j at n x d base parameters, n x q.
  Eigen::MatrixXd BaseDerivative(const Eigen::MatrixXd& base, Eigen::Index j) const;
  /// Covariances of what is not known at m points, in the factor that Predict squares: m x P';
  /// covariance of points a and b in coordinate c is sum_j factor(a, j) factor(b, j) shrink(j, c).
  Eigen::MatrixXd Factor(const DesignPoints& points) const;
  const Eigen::MatrixXd& shrink() const { return shrink_; }  ///< P' x q
  /// Coefficients, P x q, that are as probable as the mean ones: draw `number` of `seed`.
  Eigen::MatrixXd Realisation(std::uint64_t seed, std::uint64_t number) const;
  /// Means by these coefficients (P x q) at m points, m x q.
  Eigen::MatrixXd MeanOf(const Eigen::MatrixXd& coefficients, const DesignPoints& points) const;

 private:
  explicit FeatureEmulator(EffectFeatures features) : features_(std::move(features)) {}

  EffectFeatures features_;
  Eigen::MatrixXd coefficients_;  // P x q
  Eigen::MatrixXd directions_;    // P x P': sqrt(tau) times eigenvectors
  Eigen::MatrixXd shrink_;        // P' x q: variance along each, in units of the prior's
  EmulatorVariances variances_;
  RunVariance run_variance_;
  Eigen::VectorXd specimen_;
  double freedom_ = 0, used_ = 0;
  Eigen::MatrixXd residuals_;
  LeftOutRuns left_out_;
  int iterations_ = 0;
};

}  // namespace calib::inference
