#pragma once
// The few numbers by which a diagnosis sees histories: what base parameters and effects change, in
// coordinates in which scatter and noise are both diagonal.

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/feature_emulator.h"
#include "inference/diagnosis/stage_projection.h"

namespace calib::inference {

/// Runs of a set of tests as histories of T readings, on a scale on which errors add (a stress with
/// a relative error: its logarithm).
struct SetRuns {
  std::vector<PathCurve> curves{};      ///< of the T readings, one after the other
  std::vector<DesignEffect> effects{};  ///< K
  DesignPoints points{};                ///< N
  std::vector<int> packing{};           ///< N, see EmulatorData
  Eigen::MatrixXd histories{};          ///< N x T
  CalculatedDifferences differences{};  ///< D x T of outputs
  Eigen::MatrixXd noise{};              ///< T x T: covariance of the readings' noise
  /// T x J, J >= 0: what numerical choices change, each with an amplitude of variance one.
  Eigen::MatrixXd staging{};
  double share = 1;  ///< part of the scatter's variance that the measurement has as well, (0, 1]
  /// R x T: departures from their mean of twins, runs of one parameter vector on the only packing
  /// whose trajectories have parted; no rows, or two and more.
  Eigen::MatrixXd twins{};
};

/// How many coordinates, and of what.
struct CoordinateOptions {
  /// Coordinates kept, >= 2: seventeen effects of two triaxial tests span about 13 directions, base
  /// parameters up to four beside.
  int count = 20;
  int rest = 2;  ///< of these: smoothest of what neither base nor effects span, 0 <= rest < count
};

/// What is left out of the coordinates, judged by itself.
struct LeftOutMisfit {
  double square = 0;    ///< of a measurement's distance from a point, over what is left out
  double expected = 0;  ///< of the model where it is right; 0: nothing is left out
  double chance = 1;    ///< of a square as large, by Fisher's law of as much freedom as it has
};

/// Coordinates of histories. Stage functions are whitened by scatter of one specimen and noise;
/// kept are the directions of the base parameters' sensitivities over the base runs (singular
/// vectors to 99 % of their squares, d to 2 d), then those of the effects' signatures, taken from
/// an emulator of all functions at one and three units, freed of the sensitivities at their point
/// and scaled to length one (a plain principal component analysis would lose small effects), then
/// those closest to constants and trends of stages. Last they are turned and scaled so that scatter
/// and noise are diagonal with sum one. [generalised eigenproblem: Golub & Van Loan 2013, sec. 8.7]
/// Immutable; thread safety: const.
class StageCoordinates {
 public:
  /// Deterministic. Errors: INVALID_ARGUMENT for what does not fit or is not finite, a noise that
  /// is no covariance; FAILED_PRECONDITION for fewer runs without effects than base features and
  /// ten, or as FeatureEmulator::Fit.
  static absl::StatusOr<StageCoordinates> Fit(const SetRuns& runs,
                                              const CoordinateOptions& options = {});

  Eigen::Index count() const { return weights_.rows(); }  ///< q
  /// Coordinates of histories (n x T), n x q.
  Eigen::MatrixXd Of(const Eigen::MatrixXd& histories) const {
    return (histories.rowwise() - mean_) * weights_.transpose();
  }
  /// Coordinates of differences of histories (n x T), n x q.
  Eigen::MatrixXd OfDifferences(const Eigen::MatrixXd& differences) const {
    return differences * weights_.transpose();
  }
  const Eigen::MatrixXd& weights() const { return weights_; }  ///< q x T
  const Eigen::VectorXd& noise() const { return noise_; }      ///< q: variance of the noise
  /// Part of each signature's square that the kept directions hold, in the order of the effects,
  /// and of each its signs, strengths and points; (0, 1].
  const std::vector<double>& captured() const { return captured_; }
  /// By how much farther runs on a packing lie from the mean, in squares, by the scatter of the
  /// other packings than by that of all; >= 1. Scatter of a new specimen is larger by as much.
  double optimism() const { return optimism_; }
  /// Histories that the model is expected to show at points, n x T: mean of the runs without
  /// effects and what the points change of the stage functions; what changes within a stage more
  /// quickly than these is left at that mean.
  Eigen::MatrixXd HistoriesAt(const DesignPoints& points) const;
  /// What a measured history (T) shows beside the coordinates at one point of the model.
  ///                                  [square of correlated normals: Box, Ann. Math. Stat. 25
  ///                                  (1954) 290]
  LeftOutMisfit LeftOut(const Eigen::VectorXd& history, const DesignPoints& point) const;

 private:
  explicit StageCoordinates(FeatureEmulator all) : all_(std::move(all)) {}

  Eigen::RowVectorXd mean_;  // T
  Eigen::MatrixXd weights_;  // q x T
  Eigen::VectorXd noise_;
  double optimism_ = 1;
  std::vector<double> captured_;
  Eigen::MatrixXd whitener_;         // M x T: whitened stage functions
  Eigen::MatrixXd rest_;             // (M - q) x M: orthonormal, what is left out of them
  Eigen::MatrixXd rest_covariance_;  // (M - q)^2: of a measurement about the mean there
  FeatureEmulator all_;              // of the M whitened stage functions
};

}  // namespace calib::inference
