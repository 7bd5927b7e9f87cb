#pragma once
// Covariance of the scatter between packings from runs on them, and for each packing the one that
// knows nothing of it.

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

namespace calib::inference {

struct PackingScatter {
  Eigen::MatrixXd covariance;  ///< T x T, scatter and `rest`
  /// T x T each, of the packings in ascending order of their numbers: from the runs on the others
  /// alone, as `covariance` is from all, so that what a run on the packing left out departs by,
  /// judged by it, is like what a measurement departs by, judged by `covariance`.
  std::vector<Eigen::MatrixXd> without;
  std::vector<int> group;  ///< n, of each run: place of its packing in `without`
};

/// Scatter as the runs show it, as far as their number supports it (ShrinkCovariance towards a
/// closed form), plus `rest`. A packing leaves traces in what the runs on others depart by (their
/// mean holds it) and in the closed form: without it both are taken anew.
/// in:  departures n x T of runs from the mean over all packings, scaled to the variance of a
///      measurement about it; packing, n numbers of any value, three different ones or more
///      closed_form: T x T, from all packings or all but the one named, about the mean over them,
///      scaled likewise
///      rest: T x T, positive definite: what a measurement departs by beside scatter
PackingScatter ScatterBetweenPackings(
    const Eigen::MatrixXd& departures, const std::vector<int>& packing,
    const std::function<Eigen::MatrixXd(std::optional<int> left_out)>& closed_form,
    const Eigen::MatrixXd& rest);

}  // namespace calib::inference
