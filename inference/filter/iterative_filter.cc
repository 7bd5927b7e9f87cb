#include "inference/filter/iterative_filter.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/data/gaussian_likelihood.h"

namespace calib::inference {
namespace {

constexpr double kLeastScale = 0.1;  // of a mean near zero, in prior sd; chosen
constexpr double kImmaterial = 3;    // sd per move that nobody can act on; chosen

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

absl::Status FilterOptions::Validate() const {
  if (!(ess_target > 0 && ess_target < 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("ess_target is ", ess_target, "; it must lie between 0 and 1."));
  }
  if (!(tolerance > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance is ", tolerance, "; it must be positive."));
  }
  if (!(defensive_share >= 0 && defensive_share < 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("defensive_share is ", defensive_share, "; it must lie in [0, 1)."));
  }
  if (max_components < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_components is ", max_components, "; it must be at least 1."));
  }
  if (!(concentration > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("concentration is ", concentration, "; it must be positive."));
  }
  return absl::OkStatus();
}

std::vector<char> ConvergedMeans(const Posterior& before, const Posterior& now,
                                 const FilterOptions& options) {
  if (before.parameters.size() != now.parameters.size()) return {};
  std::vector<char> converged;
  for (std::size_t j = 0; j < now.parameters.size(); ++j) {
    const ParameterSummary& parameter = now.parameters[j];
    const double scale = std::max(std::abs(parameter.mean), kLeastScale * parameter.prior_sd);
    const double change = std::abs(parameter.mean - before.parameters[j].mean);
    const bool tempered = options.noise == NoiseMode::kEssTarget || std::isnan(parameter.sd);
    const double immaterial = tempered ? 0 : parameter.sd / kImmaterial;
    converged.push_back(change <= std::max(options.tolerance * scale, immaterial) ? 1 : 0);
  }
  return converged;
}

bool MeansConverged(const Posterior& before, const Posterior& now, const FilterOptions& options) {
  if (before.parameters.size() != now.parameters.size()) return false;
  const std::vector<char> converged = ConvergedMeans(before, now, options);
  return std::all_of(converged.begin(), converged.end(), [](char c) { return c != 0; });
}

absl::StatusOr<Eigen::VectorXd> LogLikelihood(const DataSet& data, const FilterOptions& options,
                                              const Eigen::MatrixXd& predictions) {
  ASSIGN_OR_RETURN(const auto likelihood, LikelihoodFor(data, options, predictions));
  return likelihood.LogLikelihood(predictions);
}

absl::StatusOr<Eigen::VectorXd> LogLikelihoodBound(const DataSet& data,
                                                   const FilterOptions& options,
                                                   const Eigen::MatrixXd& predictions) {
  ASSIGN_OR_RETURN(const auto likelihood, LikelihoodFor(data, options, predictions));
  return likelihood.LogLikelihoodBound(predictions);
}

}  // namespace calib::inference
