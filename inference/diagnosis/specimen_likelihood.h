#pragma once
// How probable a measurement on one specimen is where an emulator stands for the model.

#include <Eigen/Core>
#include <vector>

#include "inference/diagnosis/feature_emulator.h"

namespace calib::inference {

/// What a measurement departs by from the mean over packings, in q coordinates in which scatter and
/// noise are diagonal.
struct SpecimenErrors {
  Eigen::VectorXd specimen{};  ///< q: variance of a specimen of as many grains as the model's
  Eigen::VectorXd run{};       ///< q: variance of a run; the unit of added_run_variance
  Eigen::VectorXd noise{};     ///< q: variance of the readings' noise
  Eigen::VectorXd missed{};   ///< q: variance of what the emulator misses of runs beyond what their
                              ///< twins scatter by (twin_scatter.h); empty: none
  Eigen::MatrixXd staging{};  ///< q x J, J >= 0: what rate, step, damping change, amplitudes normal
                              ///< of variance one
  double share =
      1;  ///< part of the specimen's variance that the measurement has: grains over grains
  double freedom = 20;  ///< of the Student law, > 0; infinite: normal

  /// q: variances that a measurement has of its own.
  Eigen::VectorXd Own() const { return share * specimen + noise; }
  /// q: Own() and what is missed.
  Eigen::VectorXd OfMeasurement() const {
    return missed.size() > 0 ? Eigen::VectorXd(Own() + missed) : Own();
  }
};

/// A discrepancy that no base parameter can mimic: normal, of covariance tau^2 / (q - d) P at each
/// point, P the projection onto what is orthogonal to the d sensitivities there.
struct OrthogonalDiscrepancy {
  std::vector<Eigen::MatrixXd> sensitivities{};  ///< d of m x q
  Eigen::VectorXd tau{};                         ///< m, > 0: expected length
};

/// ln of the density of the measured coordinates z (q) at each of m points: Student's law of scale
///   V = diag(share specimen + missed + run added_run_variance + noise + emulator variance)
///       + staging staging^T
/// about the emulated mean, which is what a normal law becomes where its covariance is known from
/// few runs.      [Sellentin & Heavens, MNRAS 456 (2016) L132; Kotz & Nadarajah 2004, Eq. 1.1]
/// The emulator's variance at a point averages the evidence over what the emulator does not know.
/// Pure. Sizes as stated.
Eigen::VectorXd SpecimenLogDensity(const Eigen::VectorXd& z, const EmulatorPrediction& prediction,
                                   const SpecimenErrors& errors);

/// The same with a discrepancy in V; q > d.
Eigen::VectorXd SpecimenLogDensity(const Eigen::VectorXd& z, const EmulatorPrediction& prediction,
                                   const SpecimenErrors& errors,
                                   const OrthogonalDiscrepancy& discrepancy);

/// The diagonal part of V at each point, m x q.
Eigen::MatrixXd DiagonalVariance(const EmulatorPrediction& prediction,
                                 const SpecimenErrors& errors);

}  // namespace calib::inference
