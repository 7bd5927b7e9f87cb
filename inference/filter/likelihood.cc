// The likelihood as the server asks for it: of finished rows and as a bound for running ones.

#include "absl/strings/str_cat.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"

namespace calib::inference {
namespace {

absl::StatusOr<GaussianLikelihood> LikelihoodFor(const DataSet& data, const FilterOptions& options,
                                                 const Eigen::MatrixXd& predictions) {
  if (options.noise == NoiseMode::kEssTarget) {
    return absl::FailedPreconditionError(
        "with an effective-sample-size target the noise is known only when the iteration is "
        "complete; a sample's "
        "likelihood cannot be given before.");
  }
  if (predictions.cols() != static_cast<Eigen::Index>(data.readings.size())) {
    return absl::InvalidArgumentError(absl::StrCat(
        predictions.cols(), " predictions per sample for ", data.readings.size(), " readings."));
  }
  return GaussianLikelihood::Create(data, options.noise);
}

}  // namespace

absl::StatusOr<Eigen::VectorXd> LogLikelihood(const DataSet& data, const FilterOptions& options,
                                              const Eigen::MatrixXd& predictions) {
  const auto likelihood = LikelihoodFor(data, options, predictions);
  if (!likelihood.ok()) return likelihood.status();
  return likelihood->LogLikelihood(predictions);
}

absl::StatusOr<Eigen::VectorXd> LogLikelihoodBound(const DataSet& data,
                                                   const FilterOptions& options,
                                                   const Eigen::MatrixXd& predictions) {
  const auto likelihood = LikelihoodFor(data, options, predictions);
  if (!likelihood.ok()) return likelihood.status();
  return likelihood->LogLikelihoodBound(predictions);
}

}  // namespace calib::inference
