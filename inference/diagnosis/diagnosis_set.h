#pragma once
// A set of tests as the diagnosis sees it: coordinates, emulator and errors in one likelihood. All
// fitted tests are one set; a next experiment is another.

#include <Eigen/Core>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "inference/diagnosis/feature_emulator.h"
#include "inference/diagnosis/specimen_likelihood.h"
#include "inference/diagnosis/stage_coordinates.h"

namespace calib::inference {

/// Coordinates, emulator and errors of one set. Immutable; thread safety: const.
class DiagnosisSet {
 public:
  /// Learns from the runs of a set. Deterministic. Errors: as StageCoordinates::Fit and
  /// FeatureEmulator::Fit.
  static absl::StatusOr<DiagnosisSet> Fit(const SetRuns& runs,
                                          const CoordinateOptions& options = {});
  /// The same tests with other runs beside, in the coordinates of `like`.
  static absl::StatusOr<DiagnosisSet> Refit(const DiagnosisSet& like, const SetRuns& runs);
  /// A set whose emulator and errors are known, without coordinates of histories.
  DiagnosisSet(FeatureEmulator emulator, SpecimenErrors errors)
      : emulator_(std::move(emulator)), errors_(std::move(errors)) {}

  const FeatureEmulator& emulator() const { return emulator_; }
  const SpecimenErrors& errors() const { return errors_; }
  /// Null where the set was made without them.
  const StageCoordinates* coordinates() const { return coordinates_.get(); }

  /// ln of the density of measured coordinates z (q), the mean over n >= 1 specimens, at m points.
  Eigen::VectorXd LogDensity(const Eigen::VectorXd& z, const DesignPoints& points,
                             int specimens = 1) const;
  /// The same for the base model with a discrepancy of expected length tau (m, > 0) that is
  /// orthogonal to its sensitivities.
  Eigen::VectorXd LogDensityWithDiscrepancy(const Eigen::VectorXd& z, const DesignPoints& points,
                                            const Eigen::VectorXd& tau, int specimens = 1) const;
  /// errors() of the mean over n >= 1 specimens: what each has of its own is less, what they share
  /// (emulator, what it misses, staging, discrepancy) is not.
  SpecimenErrors ErrorsOfMean(int specimens) const;

 private:
  static absl::StatusOr<DiagnosisSet> WithCoordinates(
      std::shared_ptr<const StageCoordinates> coordinates, const SetRuns& runs);

  std::shared_ptr<const StageCoordinates> coordinates_;
  FeatureEmulator emulator_;
  SpecimenErrors errors_;
};

}  // namespace calib::inference
