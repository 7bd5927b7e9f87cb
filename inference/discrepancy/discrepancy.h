#pragma once
// A Gaussian process over the loading path for what a model leaves unexplained [Kennedy & O'Hagan
// 2001]; see README.md for the model and its priors.

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::inference {

/// Residual of one observable in one experiment.
struct DiscrepancyCurve {
  Eigen::VectorXd path;        ///< n >= 1: distance travelled along the loading path
  Eigen::VectorXd residual;    ///< n, model - measurement
  Eigen::MatrixXd covariance;  ///< n x n, positive definite: what is known of the errors
  double scale = 1;            ///< S > 0, size of the curve in the residual's unit
};

struct DiscrepancyOptions {
  double none = 0.5;       ///< prior probability of no discrepancy, in (0, 1)
  double least = 1e-3;     ///< smallest amplitude over S, > 0
  double most = 0.3;       ///< largest
  int amplitudes = 25;     ///< of the grid, even in ln a, >= 1
  double shortest = 0.05;  ///< length over the longest path, > 0
  double longest = 2;
  int lengths = 10;                            ///< even in ln l, >= 1
  std::vector<double> alike = {0, 0.5, 0.95};  ///< rho in [0, 1); of several curves only
  /// Readings of a curve that are used, evenly spread: leaving readings out loses information, but
  /// makes nothing wrong.
  int most_readings = 40;
};

/// Of the discrepancy at m places.
struct DiscrepancyBand {
  Eigen::VectorXd mean;
  Eigen::VectorXd sd;   ///< about the mean
  Eigen::VectorXd rms;  ///< sqrt(mean^2 + sd^2)
};

class Discrepancy {
 public:
  /// Curves of one observable. Deterministic. Errors: INVALID_ARGUMENT naming what does not fit.
  static absl::StatusOr<Discrepancy> Fit(std::vector<DiscrepancyCurve> curves,
                                         const DiscrepancyOptions& options = {});

  /// Posterior probability that there is one.
  [[nodiscard]] double probability() const { return probability_; }

  /// ln of the evidence of a discrepancy over that of none.
  [[nodiscard]] double log_bayes_factor() const { return log_bayes_factor_; }

  /// Posterior of ln a and ln l given that there is one: mean and standard deviation.
  struct Moments {
    double mean = 0, sd = 0;
  };
  [[nodiscard]] Moments log_amplitude() const { return log_amplitude_; }  ///< relative to S
  [[nodiscard]] Moments log_length() const { return log_length_; }        ///< in units of the path
  [[nodiscard]] Moments alike() const { return alike_; }

  /// Posterior of delta, "none" included. curve: one of the fitted, or -1 for a further experiment;
  /// scale: S of that one.
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
