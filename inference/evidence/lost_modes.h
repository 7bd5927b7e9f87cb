#pragma once
// Modes that iterations of importance sampling have seen and left. Pure functions.

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace calib::inference {

/// N runs of a model of d parameters and T readings, as importance sampling knows them.
struct SampledModel {
  Eigen::MatrixXd points;          ///< N x d, in standardised coordinates (Prior::ToStandard)
  Eigen::MatrixXd predictions;     ///< N x T
  Eigen::VectorXd log_start;       ///< N: ln prior / proposal
  Eigen::VectorXd log_likelihood;  ///< N; -infinity: no weight
  /// ln of the prior's density per unit of these coordinates, of each row of points (m x d).
  std::function<Eigen::VectorXd(const Eigen::MatrixXd&)> log_prior;
  /// ln L of each row of predictions (m x T).
  std::function<Eigen::VectorXd(const Eigen::MatrixXd&)> likelihood;
};

/// A basin of the posterior: samples from which the way up, each time to the best of the nearest,
/// ends at one sample.
struct Basin {
  Eigen::Index best = 0;              ///< its sample of the largest density
  std::vector<Eigen::Index> members;  ///< ascending
  double ess = 0;                     ///< effective samples among them
  double log_evidence = 0;            ///< ln of its part of Z by its weights
};

/// The basins of the samples, best first. Of more than 4000 samples every k-th is looked at.
std::vector<Basin> FindBasins(const SampledModel& samples);

/// A mode that a basin's runs point to and that no sample has met.
struct LostMode {
  Eigen::Index best = 0;    ///< the basin's best sample
  double log_evidence = 0;  ///< ln of its part of Z as expected, less `error`
  double error = 0;         ///< standard error of what is expected, by leaving out a run
  double found = 0;         ///< ln of what the weights of all basins that point to it hold of Z
};

/// What the weights may have lost.
struct LostModes {
  double log_evidence = 0;           ///< by which ln Z would grow with what is missing, >= 0
  std::vector<LostMode> modes = {};  ///< largest first
};

/// Iterations that shrink towards one mode can leave another with a few samples on its flanks, of
/// next to no weight, and neither the weights' spread nor their tail tells. The runs do: in a basin
/// with fewer than ten effective samples the 3 (d + 1) runs nearest to the best one, then to the
/// peak that these point to, give a linear model of the predictions, and that the basin's evidence:
/// Gauss-Newton steps to its peak, importance sampling there. It counts less its jackknife error
/// [Efron & Stein 1981], where the peak lies within reach of the linear model (leverage at most
/// one) and the sample nearest to it is of such a basin. What no sample has come near to, nothing
/// can tell.
LostModes FindLostModes(const SampledModel& samples);

}  // namespace calib::inference
