#include "inference/mixture/dirichlet_mixture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/mixture/k_means.h"
#include "inference/mixture/softmax_moments.h"
#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

// Starts are told apart by bounds that differ by nats; chosen on the glass-bead ensemble
// (mixture_reference_test.cc of inference_data_test), where it halves the time.
constexpr double kCoarseTolerance = 0.1;  // nats
constexpr std::size_t kFinalists = 2;     // starts that are run on to options.tolerance

absl::Status ValidateData(const WeightedPoints& data) {
  if (data.points.cols() != data.counts.size() || data.points.cols() == 0 ||
      !data.points.allFinite() || !data.counts.allFinite() || data.counts.minCoeff() < 0) {
    return absl::InvalidArgumentError(
        "a mixture needs at least one point, finite coordinates and one finite count >= 0 per "
        "point.");
  }
  if (!(data.counts.sum() > 1)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "a mixture needs more than one effective sample; there are ", data.counts.sum(), "."));
  }
  return absl::OkStatus();
}

// Moments of hard responsibilities from k-means. The largest cluster takes the first stick: sticks
// are not exchangeable, and the bound prefers them in falling order, an exchange that coordinate
// ascent cannot make.
Eigen::MatrixXd StartMoments(const WeightedPoints& data, const Eigen::MatrixXd& features,
                             int clusters, int components, PhiloxStream& stream) {
  const std::vector<int> labels = KMeans(data, clusters, stream);
  std::vector<double> sizes(clusters, 0);
  for (std::size_t i = 0; i < labels.size(); ++i)
    sizes[labels[i]] += data.counts[static_cast<Eigen::Index>(i)];
  std::vector<int> order(clusters);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&sizes](int a, int b) { return sizes[a] > sizes[b]; });
  std::vector<int> rank(clusters);
  for (int k = 0; k < clusters; ++k) rank[order[k]] = k;
  Eigen::MatrixXd moments = Eigen::MatrixXd::Zero(features.cols(), components);
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    moments.col(rank[labels[i]]) += data.counts[row] * features.row(row).transpose();
  }
  return moments;
}

// E and M steps until the bound changes by less than the tolerance or the iterations, earlier ones
// counted, run out.
void Ascend(int max_iterations, double tolerance, SoftmaxMoments& samples, DirichletMixture& fit) {
  CovarianceFactors factors = FactorsOf(fit.state);
  fit.converged = false;
  while (fit.iterations < max_iterations && !fit.converged) {
    samples.Pass(LogDensityCoefficients(fit.state, factors, fit.prior.mean));
    fit.state = MStep(fit.prior, samples.moments());
    factors = FactorsOf(fit.state);
    const double bound = IterationBound(fit.state, factors, samples.entropy());
    fit.converged = std::abs(bound - fit.lower_bound) < tolerance;
    fit.lower_bound = bound;
    ++fit.iterations;
  }
}

DirichletMixture Begin(const MixturePrior& prior, const DirichletMixtureOptions& options,
                       const Eigen::MatrixXd& moments, SoftmaxMoments& samples) {
  DirichletMixture fit;
  fit.prior = prior;
  fit.state = MStep(fit.prior, moments);
  fit.lower_bound = -std::numeric_limits<double>::infinity();
  Ascend(options.max_iterations, options.tolerance, samples, fit);
  return fit;
}

}  // namespace

absl::Status DirichletMixtureOptions::Validate() const {
  if (max_components < 1 || max_iterations < 1 || restarts < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_components, max_iterations and restarts are ", max_components, ", ",
                     max_iterations, " and ", restarts, "; each must be at least 1."));
  }
  if (!(concentration > 0) || !(tolerance > 0) || !(covariance_floor >= 0)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "concentration, tolerance and covariance_floor are ", concentration, ", ", tolerance,
        " and ", covariance_floor, "; the first two must be positive, the last not negative."));
  }
  return absl::OkStatus();
}

std::vector<MixtureComponent> DirichletMixture::PlugIn(double negligible) const {
  const Eigen::VectorXd weights = state.Weights();
  std::vector<MixtureComponent> components;
  double total = 0;
  for (Eigen::Index k = 0; k < state.size(); ++k) {
    if (weights[k] < negligible) continue;
    components.push_back(
        {.weight = weights[k], .mean = state.means.col(k), .covariance = state.covariances[k]});
    total += weights[k];
  }
  for (MixtureComponent& component : components) component.weight /= total;
  return components;
}

std::vector<MixtureComponent> DirichletMixture::Predictive(double negligible) const {
  DirichletMixture widened = *this;
  const auto d = static_cast<double>(state.means.rows());
  for (Eigen::Index k = 0; k < state.size(); ++k) {
    const double nu = state.degrees_of_freedom[k];
    widened.state.covariances[k] *=
        nu * (1 + 1 / state.mean_precision[k]) / std::max(nu - d - 1, 1.0);
  }
  return widened.PlugIn(negligible);
}

DirichletMixture FitFrom(const WeightedPoints& data, const DirichletMixtureOptions& options,
                         const Eigen::MatrixXd& responsibilities) {
  const MixturePrior prior = EmpiricalPrior(data, options.concentration, options.covariance_floor);
  const Eigen::MatrixXd features = QuadraticFeatures(data.points, prior.mean);
  SoftmaxMoments samples(features, data.counts, static_cast<int>(responsibilities.cols()));
  return Begin(prior, options, features.transpose() * (data.counts.asDiagonal() * responsibilities),
               samples);
}

absl::StatusOr<DirichletMixture> FitDirichletMixture(const WeightedPoints& data,
                                                     const DirichletMixtureOptions& options) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(ValidateData(data));
  const MixturePrior prior = EmpiricalPrior(data, options.concentration, options.covariance_floor);
  if (Eigen::LLT<Eigen::MatrixXd>(prior.inverse_scale).info() != Eigen::Success) {
    return absl::FailedPreconditionError(
        "the samples with weight do not span all directions of parameter space: no covariance can "
        "be estimated.");
  }
  const Eigen::MatrixXd features = QuadraticFeatures(data.points, prior.mean);
  SoftmaxMoments samples(features, data.counts, options.max_components);
  DirichletMixtureOptions coarse = options;
  coarse.tolerance = std::max(options.tolerance, kCoarseTolerance);
  std::vector<DirichletMixture> fits;
  for (int start = 0; start < options.restarts; ++start) {
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kMixtureStart,
                         .iteration = options.stream,
                         .sample = static_cast<std::uint64_t>(start)});
    const int variation = start % 2 == 0 ? 0 : start / 2 % options.max_components;
    fits.push_back(Begin(prior, coarse,
                         StartMoments(data, features, options.max_components - variation,
                                      options.max_components, stream),
                         samples));
  }
  const auto larger_bound = [](const DirichletMixture& a, const DirichletMixture& b) {
    return a.lower_bound > b.lower_bound;
  };
  std::stable_sort(fits.begin(), fits.end(), larger_bound);
  fits.resize(std::min(fits.size(), kFinalists));
  for (DirichletMixture& fit : fits)
    Ascend(options.max_iterations, options.tolerance, samples, fit);
  std::stable_sort(fits.begin(), fits.end(), larger_bound);
  return std::move(fits.front());
}

}  // namespace calib::inference
