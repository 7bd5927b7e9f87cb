#pragma once
// Covariance of the scatter between packings from runs on them, and for each packing the one that
// knows nothing of it.

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

namespace calib::inference {

/// Covariances of T readings about the mean over packings, from n runs on packings.
struct PackingScatter {
  Eigen::MatrixXd covariance;  ///< T x T: scatter between packings and what departs beside it
  /// T x T for each packing in ascending order of their numbers: `covariance` as the runs on the
  /// other packings alone give it. What a run on the packing departs by, judged by it, is like what
  /// a measurement departs by, judged by `covariance`.
  std::vector<Eigen::MatrixXd> without;
  std::vector<int> group;  ///< n: for each run the place of its packing in `without`
};

/// Scatter as the runs show it, as far as their number supports it (ShrinkCovariance towards a
/// closed form), plus `rest`. A packing leaves traces in what the runs on others depart by (their
/// mean holds it) and in the closed form: without it both are taken anew. Pure where closed_form
/// is.
/// in: departures n x T of runs from the mean over all packings, scaled to the variance that a
///     measurement has about it; packing, n numbers of any value, three different ones or more;
///     closed_form, gives a T x T covariance of such departures, of runs on all packings or on all
///     but the one left out; rest, T x T, positive definite: covariance of what a measurement
///     departs by beside scatter
PackingScatter ScatterBetweenPackings(
    const Eigen::MatrixXd& departures, const std::vector<int>& packing,
    const std::function<Eigen::MatrixXd(std::optional<int> left_out)>& closed_form,
    const Eigen::MatrixXd& rest);

}  // namespace calib::inference
