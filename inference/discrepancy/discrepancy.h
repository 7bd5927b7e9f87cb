#pragma once
// A Gaussian process over the loading path for what a model leaves unexplained
// [Kennedy & O'Hagan, J. R. Stat. Soc. B 63 (2001) 425].

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::inference {

/// Residual r_e of one observable in one experiment e, at n readings.
struct DiscrepancyCurve {
  Eigen::VectorXd path;        ///< n >= 1: distance travelled along the loading path
  Eigen::VectorXd residual;    ///< n, model - measurement
  Eigen::MatrixXd covariance;  ///< n x n, positive definite: of the errors, as known otherwise
  double scale = 1;            ///< S_e > 0, size of the curve (its rms) in the residual's unit
};

/// Priors of a Discrepancy and the grid they are integrated on. Chosen: more than 30 % of a curve
/// is another model, not a discrepancy, and what poor data cannot exclude would swamp predictions.
struct DiscrepancyOptions {
  double none = 0.5;       ///< prior probability of no discrepancy, in (0, 1)
  double least = 1e-3;     ///< smallest amplitude a, relative to the curves' sizes, > 0
  double most = 0.3;       ///< largest amplitude, >= least
  int amplitudes = 25;     ///< of the grid, even in ln a, >= 1
  double shortest = 0.05;  ///< shortest length l over the longest path, > 0
  double longest = 2;      ///< longest length over the longest path, >= shortest
  int lengths = 10;        ///< of the grid, even in ln l, >= 1
  /// Values of rho in [0, 1), how alike the discrepancies of two experiments are; of several
  /// curves.
  std::vector<double> alike = {0, 0.5, 0.95};
  /// Readings of a curve that are used, evenly spread, >= 1: leaving readings out loses
  /// information, but makes nothing wrong.
  int most_readings = 40;
};

/// Posterior of the discrepancy at m places, in the residual's unit.
struct DiscrepancyBand {
  Eigen::VectorXd mean;  ///< m
  Eigen::VectorXd sd;    ///< m, about the mean
  Eigen::VectorXd rms;   ///< m, sqrt(mean^2 + sd^2)
};

/// What a model leaves unexplained of one observable over several experiments:
///   r_e(s) = delta_e(s) + error,  error ~ N(0, C_e) with the curves' covariances,
///   delta_e(s) ~ GP(0, a^2 S_e S_e' (rho + (1 - rho) [e = e']) M_5/2(|s - s'| / l))
/// with M_5/2 the Matern 5/2 function and s the path. With probability `none` there is no
/// discrepancy, a = 0; else a and l are log-uniform, rho uniform, each on its grid. All is
/// integrated, nothing maximised: an amplitude that the noise hides stays small and uncertain
/// instead of zero and certain. A value; immutable after Fit. Thread safety: const.
class Discrepancy {
 public:
  /// The posterior given the curves of one observable. Deterministic. Errors: INVALID_ARGUMENT
  /// naming what does not fit.
  static absl::StatusOr<Discrepancy> Fit(std::vector<DiscrepancyCurve> curves,
                                         const DiscrepancyOptions& options = {});

  /// Posterior probability that there is a discrepancy.
  [[nodiscard]] double probability() const { return probability_; }

  /// ln of the evidence of a discrepancy over the evidence of none.
  [[nodiscard]] double log_bayes_factor() const { return log_bayes_factor_; }

  /// Mean and standard deviation of a posterior.
  struct Moments {
    double mean = 0, sd = 0;
  };
  /// Posterior of ln a given that there is a discrepancy; a is relative to the curves' sizes.
  [[nodiscard]] Moments log_amplitude() const { return log_amplitude_; }
  /// Posterior of ln l given that there is a discrepancy; l in units of the path.
  [[nodiscard]] Moments log_length() const { return log_length_; }
  /// Posterior of rho given that there is a discrepancy.
  [[nodiscard]] Moments alike() const { return alike_; }

  /// Posterior of delta_e at m places of the path, "no discrepancy" included. curve: index of e
  /// among the fitted ones, or -1 for a further experiment; scale: S_e.
  [[nodiscard]] DiscrepancyBand At(int curve, const Eigen::VectorXd& path, double scale) const;

 private:
  // One length and likeness: the readings in the basis where errors are white and the process
  // diagonal.
  struct Basis {
    double length = 0, alike = 0;
    Eigen::MatrixXd back;      // C^(-1/2)^T U
    Eigen::VectorXd lambda;    // eigenvalues of C^(-1/2) K C^(-T/2), K with a = 1
    Eigen::VectorXd z;         // U^T C^(-1/2) r
    std::vector<double> mass;  // per amplitude
  };
  [[nodiscard]] Eigen::MatrixXd Kernel(const Basis& basis, int curve, const Eigen::VectorXd& path,
                                       double scale) const;

  std::vector<double> amplitudes_;
  std::vector<Basis> bases_;
  Eigen::VectorXd path_;  // of all used readings
  std::vector<int> curve_;
  Eigen::VectorXd scale_;
  double probability_ = 0, log_bayes_factor_ = 0;
  Moments log_amplitude_, log_length_, alike_;
};

}  // namespace calib::inference
