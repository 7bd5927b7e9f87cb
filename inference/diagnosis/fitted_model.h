#pragma once
// A model as the statistics of the diagnosis see it.

#include <Eigen/Core>
#include <vector>

#include "inference/diagnosis/histories.h"

namespace calib::inference {

/// A model as a cloud of what it can do. Histories are (prediction - reading) / noise sd.
struct FittedModel {
  Histories histories;         ///< G of T, mean history at G points of its parameter space
  Eigen::MatrixXd covariance;  ///< T x T, of a measurement about the true mean history: noise,
                               ///< scatter, error of the emulator, numerical nuisance
  int parameters = 0;
  /// S x T: differences of measurements from the true mean history, S >= 50, as real ones would be;
  /// with none they are normal with the covariance. A covariance that is merely cautious makes
  /// distances too small and hides misfit; these say how large distances are of a right model.
  Eigen::MatrixXd draws{};
  /// A covariance that was estimated from the runs that draws are made of is too close to them.
  /// Where `without` has entries, draw i is judged by without[group[i]], which knows nothing of its
  /// run; the measurement is judged by `covariance`.
  std::vector<int> group{};                ///< S
  std::vector<Eigen::MatrixXd> without{};  ///< T x T each
  /// Packings that the covariance of scatter is known from, all of them in `draws`; 0: it is known.
  /// Without entries of `without` draws lie too close to it, and p values stay large: whatever is
  /// seen may be scatter that two or three packings do not show.
  int packings = 0;
  /// T x q each, q < T: shapes along the path that the misfit of a missing effect may have. The part
  /// of the residual in their span is judged beside all of it; needs draws.
  std::vector<Eigen::MatrixXd> shapes{};
};

}  // namespace calib::inference
