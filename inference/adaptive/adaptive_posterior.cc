#include "inference/adaptive/adaptive_posterior.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "inference/evidence/adaptive_importance.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Parameters of points of the unit cube, in both units, and which of them meet the constraints.
struct Places {
  Eigen::MatrixXd parameters, standard;
  std::vector<bool> inside;
};

Places PlacesOf(const JointPrior& prior, const Eigen::MatrixXd& cube) {
  Places result{.parameters = Eigen::MatrixXd(cube.rows(), cube.cols()),
                .standard = {},
                .inside = std::vector<bool>(static_cast<std::size_t>(cube.rows()))};
  for (Index i = 0; i < cube.rows(); ++i) {
    const Eigen::VectorXd x =
        prior.FromUnit(cube.row(i).transpose().cwiseMax(1e-15).cwiseMin(1 - 1e-15));
    result.inside[static_cast<std::size_t>(i)] = prior.MeetsConstraints(x) && x.allFinite();
    result.parameters.row(i) = x.transpose();
  }
  result.standard = StandardRows(prior, result.parameters);
  return result;
}

// ln E[L] and 1/2 ln E[L^2] with the region's probability, -infinity outside the constraints.
struct Densities {
  Eigen::VectorXd mean, root_square;
};

Densities DensitiesAt(const Places& at, const ResponseEmulator& emulator,
                      const KnownRegion& region) {
  const EmulatorPrediction prediction = emulator.Predict(at.standard);
  const SpecimenErrors& errors = emulator.errors();
  SpecimenErrors half = errors;
  half.specimen /= 2;
  half.noise /= 2;
  half.freedom = kInfinity;
  const double constant = -0.5 * (4 * M_PI * errors.Own().array()).log().sum();
  const Eigen::VectorXd completes = region.LogProbability(at.standard);
  Densities result{
      .mean = SpecimenLogDensity(emulator.measured(), prediction, errors) + completes,
      .root_square =
          0.5 * (SpecimenLogDensity(emulator.measured(), prediction, half).array() + constant)
                    .matrix() +
          completes};
  for (Index i = 0; i < completes.size(); ++i) {
    if (at.inside[static_cast<std::size_t>(i)] && std::isfinite(result.mean[i])) continue;
    result.mean[i] = result.root_square[i] = -kInfinity;
  }
  return result;
}

// The errors of a measurement were the scatter another one that is as likely by the runs: Wishart's
// law of its freedom, about the one that is found.       [Anderson 2003, sec. 7.2]
SpecimenErrors WithScatterDrawn(const SpecimenErrors& found, double freedom, PhiloxStream& stream) {
  constexpr double kMostDrawn = 200;  // the scatter is as good as known
  if (freedom > kMostDrawn) return found;
  const auto count = static_cast<Index>(std::ceil(freedom));
  SpecimenErrors result = found;
  result.specimen.setZero();
  result.staging.resize(found.specimen.size(), count);
  for (double& z : result.staging.reshaped()) z = stream.Normal();
  result.staging =
      (found.share / static_cast<double>(count) * found.specimen).cwiseSqrt().asDiagonal() *
      result.staging;
  // As many columns as coordinates do.
  if (count > result.staging.rows()) {
    const Eigen::MatrixXd square = result.staging * result.staging.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(square);
    result.staging =
        eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  }
  return result;
}

// Standard errors by realisations of the emulator.
void AddErrors(const ResponseEmulator& emulator, const AdaptiveSamplingOptions& options,
               AdaptivePosterior& result) {
  const std::vector<Index> rows = Resampled(result.log_weights, options.at);
  const Eigen::MatrixXd at = result.standard(rows, Eigen::all);
  const Index m = at.rows(), q = emulator.coordinates(), d = at.cols();
  const EmulatorPrediction prediction = emulator.Predict(at);
  std::vector<Eigen::MatrixXd> root;
  for (Eigen::MatrixXd& covariance : emulator.Covariances(at, at)) {
    // Rounding, and rows drawn twice.
    covariance.diagonal().array() += 1e-10 + 1e-8 * covariance.diagonal().maxCoeff();
    root.emplace_back(Eigen::LLT<Eigen::MatrixXd>(covariance).matrixL());
  }
  const Eigen::VectorXd mean_density =
      SpecimenLogDensity(emulator.measured(), prediction, emulator.errors());
  Eigen::MatrixXd mean(options.realisations, d), log_sd(options.realisations, d);
  Eigen::VectorXd log_evidence(options.realisations);
  EmulatorPrediction drawn{.mean = Eigen::MatrixXd(m, q),
                           .variance = Eigen::MatrixXd::Zero(m, q),
                           .added_run_variance = Eigen::VectorXd::Zero(m)};
  for (int r = 0; r < options.realisations; ++r) {
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kAdaptiveErrors,
                         .iteration = options.number,
                         .sample = static_cast<std::uint64_t>(r)});
    Eigen::MatrixXd normal(m, q);
    for (double& z : normal.reshaped()) z = stream.Normal();
    for (Index k = 0; k < q; ++k) {
      drawn.mean.col(k) =
          prediction.mean.col(k) + root[static_cast<std::size_t>(k)] * normal.col(k);
    }
    const Eigen::VectorXd ratio =
        SpecimenLogDensity(
            emulator.measured(), drawn,
            WithScatterDrawn(emulator.errors(), emulator.scatter_freedom(), stream)) -
        mean_density;
    log_evidence[r] = LogSumExp(ratio) - std::log(static_cast<double>(m));
    const Eigen::VectorXd weights = NormalizedLogWeights(ratio);
    mean.row(r) = WeightedMean(weights, at).transpose();
    log_sd.row(r) = 0.5 * WeightedCovariance(weights, at, mean.row(r).transpose())
                              .diagonal()
                              .array()
                              .max(1e-300)
                              .log()
                              .matrix()
                              .transpose();
  }
  const auto spread = [](const Eigen::VectorXd& values) {
    return std::sqrt((values.array() - values.mean()).square().sum() /
                     static_cast<double>(values.size() - 1));
  };
  result.mean_error.resize(d);
  result.log_sd_error.resize(d);
  for (Index j = 0; j < d; ++j) {
    result.mean_error[j] = spread(mean.col(j));
    result.log_sd_error[j] = spread(log_sd.col(j));
  }
  result.log_evidence_error = std::hypot(spread(log_evidence), 1 / std::sqrt(result.effective));
}

}  // namespace

std::vector<Index> Resampled(const Eigen::VectorXd& log_weights, Index count) {
  std::vector<Index> result;
  double cumulated = 0;
  for (Index i = 0; i < log_weights.size(); ++i) {
    cumulated += std::exp(log_weights[i]) * static_cast<double>(count);
    while (static_cast<Index>(result.size()) < count &&
           static_cast<double>(result.size()) + 0.5 < cumulated)
      result.push_back(i);
  }
  return result;
}

AdaptivePosterior SamplePosterior(const AdaptiveProblem& problem, const ResponseEmulator& emulator,
                                  const KnownRegion& region,
                                  const AdaptiveSamplingOptions& options) {
  const auto d = static_cast<Index>(problem.prior.size());
  const CubeSample sample = SampleCube(
      [&](const Eigen::MatrixXd& points) {
        const Densities at = DensitiesAt(PlacesOf(problem.prior, points), emulator, region);
        return Eigen::VectorXd(at.mean.cwiseMax(at.root_square));
      },
      d,
      {.points = options.points,
       .effective = options.effective,
       .seed = options.seed,
       .number = options.number});
  AdaptivePosterior result;
  if (!(sample.best > -kInfinity)) return result;
  std::vector<Index> kept;
  for (Index i = 0; i < sample.log_weights.size(); ++i) {
    if (sample.log_weights[i] > -kInfinity) kept.push_back(i);
  }
  const Places at = PlacesOf(problem.prior, sample.points(kept, Eigen::all));
  const Densities densities = DensitiesAt(at, emulator, region);
  const Eigen::VectorXd cover = densities.mean.cwiseMax(densities.root_square);
  result.draws = at.parameters;
  result.standard = at.standard;
  result.log_cover = NormalizedLogWeights(sample.log_weights(kept));
  result.log_mean = densities.mean;
  result.log_root_square = densities.root_square;
  const Eigen::VectorXd weights = result.log_cover + densities.mean - cover;
  result.log_weights = NormalizedLogWeights(weights);
  result.effective = EffectiveSampleSize(weights);
  result.log_evidence = sample.evidence.log_evidence + LogSumExp(weights) -
                        problem.prior.log_mass() + emulator.log_jacobian();
  result.mean = WeightedMean(result.log_weights, result.standard);
  result.sd = WeightedCovariance(result.log_weights, result.standard, result.mean)
                  .diagonal()
                  .cwiseMax(0)
                  .cwiseSqrt();
  const Eigen::VectorXd completes = region.LogProbability(result.standard);
  for (Index i = 0; i < completes.size(); ++i) {
    if (completes[i] < std::log(0.5) + 1e-12 && region.bounded())
      result.at_edge += std::exp(result.log_weights[i]);
  }
  AddErrors(emulator, options, result);
  return result;
}

}  // namespace calib::inference
