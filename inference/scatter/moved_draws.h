#pragma once
// Draws of a posterior that is too sure, moved by what refits of the replicates add to it.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/prior/joint_prior.h"
#include "inference/scatter/refit_spread.h"

namespace calib::inference {

/// Draws of a posterior after MoveByRefits.
struct MovedDraws {
  Eigen::MatrixXd draws;  ///< n x d, in the parameters' units
  double widened = 1;     ///< largest factor on the sd of a parameter, standardised, >= 1
};

/// Moves each of n equally weighted draws of a posterior by a normal number of covariance
/// SpreadOfRefits (refit_spread.h), in standardised coordinates; drawn again where it leaves the
/// prior's support (a hundred times, then the draw stays: it lies in a corner). Deterministic in
/// seed and row.
/// in: data, with errors about a run; draws n x d, in the parameters' units; histories n x T, the
///     model's mean predictions of the readings there, in their units; free, indices of the
///     parameters that are not held at a value, ascending
MovedDraws MoveByRefits(const JointPrior& priors, const DataSet& data, const Replicates& replicates,
                        const Eigen::MatrixXd& draws, const Eigen::MatrixXd& histories,
                        const std::vector<Eigen::Index>& free, std::uint64_t seed);

}  // namespace calib::inference
