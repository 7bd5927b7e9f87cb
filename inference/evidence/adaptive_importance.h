#pragma once
// Evidence of a model with a handful of parameters whose likelihood costs next to nothing: adaptive
// importance sampling on the unit cube.

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "inference/evidence/importance_evidence.h"

namespace calib::inference {

/// ln L at the rows of m x d points of the open unit cube, m entries; -infinity allowed, no NaN.
using CubeLikelihood = std::function<Eigen::VectorXd(const Eigen::MatrixXd& points)>;

/// How SampleCube goes about it.
struct CubeSamplingOptions {
  int start = 512;         ///< Sobol points that the first proposal is made of, >= 64
  int points = 500;        ///< drawn from each proposal, >= 100
  int iterations = 4;      ///< proposals at temperature one, >= 1; up to three times as many
  double effective = 100;  ///< as long as there are fewer effective points: 0.1 nats of error
  int approaches = 40;     ///< proposals at most on the way there, >= 0
  int centres = 20;        ///< kernels of a proposal, >= 1
  double defence = 0.05;   ///< share of each proposal that is uniform in the cube, (0, 1)
  std::uint64_t seed = 0;
  /// Names the stream of this integral among those of one seed.
  std::uint64_t number = 0;
};

/// Weighted draws of a posterior, and its evidence.
struct CubeSample {
  EvidenceEstimate evidence{};  ///< integral of L over the cube
  /// ParetoTailIndex of the weights. They are bounded by the uniform share: a large index asks for
  /// more points.
  double tail = 0;
  double effective = 0;              ///< effective draws
  double best = 0;                   ///< largest ln L met
  Eigen::MatrixXd points{};          ///< n x d
  Eigen::VectorXd log_likelihood{};  ///< n
  Eigen::VectorXd log_weights{};  ///< n, of posterior draws, normalised; -infinity outside the cube
};

/// The integral of L over the unit cube of d >= 1 parameters. Points of a Sobol net, then of
/// mixtures of Student kernels (6 or 7 degrees of freedom) with a uniform share: centres are
/// resampled from the points so far, which they spread as. Likelihoods are raised to the largest
/// power that leaves max(50, 5 d) effective points, until that is one; then `iterations` proposals
/// follow, and the estimate is of all points drawn by these, each weighed by the mean density of
/// all of them, so that no point weighs more than L / defence.
///    [Cornuet, Marin, Mira & Robert, Scand. J. Stat. 39 (2012) 798, with Owen & Zhou, J. Am. Stat.
///     Assoc. 95 (2000) 135 for the defence]
/// -infinity everywhere: an evidence of -infinity with infinite error. Deterministic.
CubeSample SampleCube(const CubeLikelihood& likelihood, Eigen::Index dimensions,
                      const CubeSamplingOptions& options);

}  // namespace calib::inference
