#pragma once
// How often a right model is as far off as a measurement is, from draws that share few packings.

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace calib::inference {

/// Law of a squared distance, from n drawn ones. Within a group (draws that share a packing) it is
/// gamma with the group's mean m. A new packing has an m of its own: ln m is normal, its mean and
/// variance known from G groups, so that the next one follows Student's law with G - 1 degrees of
/// freedom [Geisser, Predictive Inference (1993), 2.2.3]. With one group, or groups that
/// differ by no more than their draws do by chance, the gamma law of all draws.
class DrawnTail {
 public:
  /// drawn: n >= 2, >= 0; group: n numbers of any value, or none: all are of one. freedom: of draws
  /// of one group that were judged by a covariance that knows their packings, from so many degrees
  /// of freedom: Fisher's law about their mean takes the place of the gamma law. 0: not so.
  DrawnTail(const Eigen::VectorXd& drawn, const std::vector<int>& group, int freedom = 0);
  bool varies() const { return variance_ > 0; }
  double mean() const { return mean_; }
  /// Chance of a square at least as large, [0, 1]; 1 where the draws do not vary.
  double operator()(double square) const;

 private:
  double mean_, variance_;
  double within_ = 0;  ///< variance about a group's mean, in squares of that mean
  int freedom_;
  /// Of a new packing: its mean, and with what weight; none with one group.
  std::vector<std::pair<double, double>> means_{};
};

}  // namespace calib::inference
