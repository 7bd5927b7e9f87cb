#include "inference/diagnosis/diagnosis_set.h"

#include <memory>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "inference/diagnosis/run_variance.h"
#include "inference/diagnosis/twin_scatter.h"

namespace calib::inference {

absl::StatusOr<DiagnosisSet> DiagnosisSet::WithCoordinates(
    std::shared_ptr<const StageCoordinates> coordinates, const SetRuns& runs) {
  if (runs.histories.cols() != coordinates->weights().cols() ||
      runs.histories.rows() != runs.points.rows())
    return absl::InvalidArgumentError("histories do not fit the coordinates");
  const Eigen::Index d = runs.points.base.cols();
  const EffectFeatures features(d, runs.effects, EffectFeatures::DegreeFor(d, runs.points.rows()));
  EmulatorData data{.points = runs.points,
                    .packing = runs.packing,
                    .outputs = coordinates->Of(runs.histories),
                    .differences = runs.differences};
  if (runs.differences.outputs.rows() > 0)
    data.differences.outputs = coordinates->OfDifferences(runs.differences.outputs);
  ASSIGN_OR_RETURN(FeatureEmulator emulator, FitWithRunVariance(features, data));
  SpecimenErrors errors{.specimen = coordinates->optimism() * emulator.specimen(),
                        .run = emulator.variances().run,
                        .noise = coordinates->noise(),
                        .staging = Eigen::MatrixXd(coordinates->count(), 0),
                        .share = runs.share,
                        .freedom = emulator.freedom()};
  if (runs.twins.rows() > 0) {
    TwinScatter split =
        SplitByTwins(coordinates->OfDifferences(runs.twins), errors.specimen, errors.freedom);
    errors.specimen = std::move(split.specimen);
    errors.missed = std::move(split.missed);
    errors.freedom = split.freedom;
  }
  if (runs.staging.size() > 0) errors.staging = coordinates->weights() * runs.staging;
  DiagnosisSet result(std::move(emulator), std::move(errors));
  result.coordinates_ = std::move(coordinates);
  return result;
}

absl::StatusOr<DiagnosisSet> DiagnosisSet::Fit(const SetRuns& runs,
                                               const CoordinateOptions& options) {
  ASSIGN_OR_RETURN(StageCoordinates coordinates, StageCoordinates::Fit(runs, options));
  return WithCoordinates(std::make_shared<const StageCoordinates>(std::move(coordinates)), runs);
}

absl::StatusOr<DiagnosisSet> DiagnosisSet::Refit(const DiagnosisSet& like, const SetRuns& runs) {
  if (like.coordinates_ == nullptr)
    return absl::InvalidArgumentError("a set without coordinates cannot be refitted");
  return WithCoordinates(like.coordinates_, runs);
}

Eigen::VectorXd DiagnosisSet::LogDensity(const Eigen::VectorXd& z, const DesignPoints& points,
                                         int specimens) const {
  return SpecimenLogDensity(z, emulator_.Predict(points), ErrorsOfMean(specimens));
}

SpecimenErrors DiagnosisSet::ErrorsOfMean(int specimens) const {
  SpecimenErrors result = errors_;
  result.specimen /= specimens;
  result.noise /= specimens;
  return result;
}

Eigen::VectorXd DiagnosisSet::LogDensityWithDiscrepancy(const Eigen::VectorXd& z,
                                                        const DesignPoints& points,
                                                        const Eigen::VectorXd& tau,
                                                        int specimens) const {
  OrthogonalDiscrepancy discrepancy{.sensitivities = {}, .tau = tau};
  for (Eigen::Index j = 0; j < points.base.cols(); ++j)
    discrepancy.sensitivities.push_back(emulator_.BaseDerivative(points.base, j));
  return SpecimenLogDensity(z, emulator_.Predict(points), ErrorsOfMean(specimens), discrepancy);
}

}  // namespace calib::inference
