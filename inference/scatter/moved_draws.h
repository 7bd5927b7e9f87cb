#pragma once
// Draws of a posterior that is too sure, moved by what refits of the replicates add to it.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/prior/joint_prior.h"
#include "inference/scatter/refit_spread.h"

namespace calib::inference {

struct MovedDraws {
  Eigen::MatrixXd draws;  ///< n x d, SI
  double widened = 1;     ///< largest factor on the sd of a parameter, standardised, >= 1
};

/// Each draw (n x d, SI, equally weighted) plus a normal number of covariance SpreadOfRefits, in
/// the standardised coordinates of the columns `free`; drawn again where it leaves the prior's
/// support (a hundred times, then it stays: it lies in a corner). histories: n x T, the model
/// there. Deterministic in seed and row.
MovedDraws MoveByRefits(const JointPrior& priors, const DataSet& data, const Replicates& replicates,
                        const Eigen::MatrixXd& draws, const Eigen::MatrixXd& histories,
                        const std::vector<Eigen::Index>& free, std::uint64_t seed);

}  // namespace calib::inference
