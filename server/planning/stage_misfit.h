#pragma once
// How well the posterior fits each observable and each of its loading stages.

#include <Eigen/Core>
#include <vector>

#include "inference/emulator/emulated_posterior.h"
#include "server/planning/definition.h"

namespace calib::planning {

/// Readings of one observable of a fitted experiment: all of them, or those of one loading stage.
struct Stage {
  int experiment = 0, observable = 0;
  int first = 0, last = 0;  ///< load steps
  inference::JudgedReadings judged{};
};

/// Every fitted observable as a whole, then its stages one after the other where it has more than
/// one. Empty where the size of the errors is not stated.
std::vector<Stage> StagesOf(const Definition& definition);

/// Posterior predictive p-value [Gelman et al. 1996] of each stage's chi-squared over runs:
/// sum_i w_i P(chi^2 >= chi^2(readings, run i)), errors as in definition.data. predictions: runs x
/// T; log_weights: one per run, normalised.
std::vector<double> StageP(const Definition& definition, const std::vector<Stage>& stages,
                           const Eigen::MatrixXd& predictions, const Eigen::VectorXd& log_weights);

}  // namespace calib::planning
