#pragma once
// How often a right model is as far off as a measurement is, from draws that share few packings.

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace calib::inference {

/// Law of a squared distance of a right model, from n drawn ones. Within a group (draws that share
/// a packing) it is gamma with the group's mean m. A new packing has an m of its own: ln m is
/// normal, its mean and variance known from G groups, so that the next one follows Student's law
/// with G - 1 degrees of freedom [Geisser, Predictive Inference (1993), 2.2.3]. With one group, or
/// groups that differ by no more than their draws do by chance, the gamma law of all draws.
/// Immutable; thread safety: const.
class DrawnTail {
 public:
  /// The law of these draws. drawn: n >= 2 squares, >= 0; group: n numbers of any value, or none:
  /// all are of one group. freedom: degrees of freedom of the covariance by which draws of one
  /// group were judged, where it was estimated from their own packings: Fisher's law about their
  /// mean then takes the place of the gamma law. 0: it knows nothing of their packings.
  DrawnTail(const Eigen::VectorXd& drawn, const std::vector<int>& group, int freedom = 0);
  bool varies() const { return variance_ > 0; }  ///< whether the drawn squares differ
  double mean() const { return mean_; }          ///< of the drawn squares
  /// Chance of a square at least as large as `square`, [0, 1]; 1 where the draws do not vary.
  double operator()(double square) const;

 private:
  double mean_, variance_;
  double within_ = 0;  // variance about a group's mean, in squares of that mean
  int freedom_;
  // Means that a new packing may have, and with what weight; none with one group.
  std::vector<std::pair<double, double>> means_{};
};

}  // namespace calib::inference
