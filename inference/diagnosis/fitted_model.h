#pragma once
// A model as the statistics of the diagnosis see it.

#include <Eigen/Core>
#include <vector>

#include "inference/diagnosis/histories.h"

namespace calib::inference {

/// A model as a cloud of what it can do. Histories, over T readings, are
/// (prediction - reading) / noise sd. A value.
struct FittedModel {
  Histories histories;  ///< G of T: the mean history at G points of its parameter space
  /// T x T: of a measurement about the true mean history; noise, scatter, error of the emulator,
  /// numerical nuisance.
  Eigen::MatrixXd covariance;
  int parameters = 0;  ///< of the model, that are fitted
  /// S x T, S >= 50: what measurements depart by from the true mean history, as real ones would. No
  /// rows: it is normal with `covariance`. A covariance that is merely cautious makes distances too
  /// small and hides misfit; draws say how large distances are of a right model.
  Eigen::MatrixXd draws{};
  std::vector<int> group{};  ///< S: for each draw its place in `without`; none where that is empty
  /// T x T each: the covariance as estimated without the runs that some of the draws are made of.
  /// One that was estimated from them is too close to them, so draw i is judged by
  /// without[group[i]]; the measurement is judged by `covariance`. Empty: all by `covariance`.
  std::vector<Eigen::MatrixXd> without{};
  /// Packings that the scatter in `covariance` is known from, all of them in `draws`; 0: it is
  /// known. Where `without` is empty draws lie too close to it, and p values stay large: whatever
  /// is seen may be scatter that two or three packings do not show.
  int packings = 0;
  /// T x q each, q < T: shapes along the path that the misfit of a missing effect may have. The
  /// part of the residual in their span is judged beside all of it; needs draws.
  std::vector<Eigen::MatrixXd> shapes{};
};

}  // namespace calib::inference
