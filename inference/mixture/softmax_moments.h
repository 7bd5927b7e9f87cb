#pragma once
// One pass over samples for a mixture of log-linear densities: E step and the sums of the M step
// together, so that no responsibility is ever stored.

#include <Eigen/Core>
#include <vector>

#include "inference/numerics/wide_exponential.h"

namespace calib::inference {

/// Moments of n samples under a mixture: for features f_n (F entries), counts c_n and coefficients
/// a_k of K components
///   ln rho_nk = f_n . a_k,  r_nk = rho_nk / sum_l rho_nl,
///   moments_k = sum_n c_n r_nk f_n,  entropy = - sum_n c_n sum_k r_nk ln r_nk.
/// Eight samples are treated side by side, in the order of the samples: the bits depend neither on
/// threads nor on how wide the machine's vectors are. r_nk below e^-700 of the largest counts as
/// e^-700 of it. Thread safety: none, Pass writes its results into the object; a thread makes its
/// own.
class SoftmaxMoments {
 public:
  /// Takes copies of features (n x F) and counts (n), both finite; n, F and components >= 1.
  SoftmaxMoments(const Eigen::MatrixXd& features, const Eigen::VectorXd& counts, int components);

  /// Computes moments() and entropy() for these coefficients, F x K, finite.
  void Pass(const Eigen::MatrixXd& coefficients);
  const Eigen::MatrixXd& moments() const { return moments_; }  ///< F x K, by the last Pass
  double entropy() const { return entropy_; }                  ///< nats, by the last Pass

 private:
  struct alignas(8 * kLanes) Group {  // one number of each of eight samples
    Lanes of;
  };
  struct Job;
  static void Run(const Job& job);
  static double SumOfLanes(const Group& group);

  int groups_ = 0;  // of kLanes samples, the last one filled up with samples of count zero
  int features_ = 0;
  int components_ = 0;
  std::vector<Group> values_;         // groups x F
  std::vector<Group> counts_;         // groups
  std::vector<double> coefficients_;  // F x K, K filled up to a multiple of four
  std::vector<Group> rho_;            // K, filled up
  std::vector<Group> sums_;           // groups: sum_k rho_nk, relative to the largest
  std::vector<Group> partial_;        // K x F: moments by lane
  Eigen::MatrixXd moments_;
  double entropy_ = 0;
};

}  // namespace calib::inference
