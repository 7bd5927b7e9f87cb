#include "inference/evidence/adaptive_importance.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "inference/evidence/pareto_tail.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/special_functions.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/philox.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Degrees of freedom of a kernel: with these (freedom + d) / 2 is a whole number, and a density
// takes neither logarithm nor exponential.
int KernelFreedom(Index dimensions) { return dimensions % 2 == 0 ? 6 : 7; }

// Kernels of this share of the covariance, about resampled points that are drawn towards the mean
// by as much, so that the mixture spreads as the points do, but for Student's tails.
//                                                       [West, J. R. Stat. Soc. B 55 (1993) 409,
//                                                       sec. 3]
constexpr double kKernelShare = 0.5;

// Student kernels of one covariance in the cube, and a uniform share.
class CubeProposal {
 public:
  CubeProposal(Eigen::MatrixXd centres, const Eigen::MatrixXd& covariance, double defence)
      : centres_(std::move(centres)), factor_(covariance), defence_(defence) {
    const auto d = static_cast<double>(centres_.cols());
    freedom_ = KernelFreedom(centres_.cols());
    power_ = (freedom_ + static_cast<int>(centres_.cols())) / 2;
    normaliser_ = std::exp(LogGamma((freedom_ + d) / 2) - LogGamma(0.5 * freedom_) -
                           0.5 * d * std::log(freedom_ * M_PI) -
                           factor_.matrixLLT().diagonal().array().log().sum());
    white_ = LowerSolved(factor_, centres_.transpose());
  }

  Eigen::MatrixXd Draw(Index n, std::uint64_t iteration, const CubeSamplingOptions& options) const {
    const Index d = centres_.cols();
    Eigen::MatrixXd points(n, d);
    const Eigen::MatrixXd lower = factor_.matrixL();
    for (Index i = 0; i < n; ++i) {
      // The integral's number and the iteration together name the stream.
      PhiloxStream stream({.seed = options.seed,
                           .purpose = StreamPurpose::kDiagnosisEvidence,
                           .iteration = (options.number << 16) + iteration,
                           .sample = static_cast<std::uint64_t>(i)});
      if (stream.Uniform() < defence_) {
        for (Index j = 0; j < d; ++j) points(i, j) = stream.Uniform();
        continue;
      }
      const auto centre =
          static_cast<Index>(stream.Uniform() * static_cast<double>(centres_.rows()));
      double chi2 = 0;
      for (int k = 0; k < freedom_; ++k) {
        const double z = stream.Normal();
        chi2 += z * z;
      }
      Eigen::VectorXd normal(d);
      for (double& z : normal) z = stream.Normal();
      points.row(i) = centres_.row(std::min(centre, centres_.rows() - 1)) +
                      (lower * normal).transpose() / std::sqrt(chi2 / freedom_);
    }
    return points;
  }

  // ln of the density at points inside the cube.
  Eigen::VectorXd LogDensity(const Eigen::MatrixXd& points) const {
    const Index n = points.rows(), kernels = centres_.rows();
    const Eigen::MatrixXd white = LowerSolved(factor_, points.transpose());
    Eigen::VectorXd result(n);
    for (Index i = 0; i < n; ++i) {
      double sum = 0;
      for (Index c = 0; c < kernels; ++c) {
        const double square = (white.col(i) - white_.col(c)).squaredNorm();
        const double base = 1 / (1 + square / freedom_);
        double kernel = base;
        for (int k = 1; k < power_; ++k) kernel *= base;
        sum += kernel;
      }
      result[i] =
          std::log((1 - defence_) * normaliser_ * sum / static_cast<double>(kernels) + defence_);
    }
    return result;
  }

 private:
  Eigen::MatrixXd centres_;  // kernels x d
  Eigen::LLT<Eigen::MatrixXd> factor_;
  double defence_, normaliser_;
  int freedom_, power_;
  Eigen::MatrixXd white_;  // d x kernels
};

// ln L of the points that lie inside the cube, -infinity of others.
Eigen::VectorXd InsideCube(const CubeLikelihood& likelihood, const Eigen::MatrixXd& points) {
  std::vector<Index> inside;
  for (Index i = 0; i < points.rows(); ++i) {
    if (points.row(i).minCoeff() > 0 && points.row(i).maxCoeff() < 1) inside.push_back(i);
  }
  Eigen::VectorXd result = Eigen::VectorXd::Constant(points.rows(), -kInfinity);
  if (inside.empty()) return result;
  const Eigen::VectorXd values = likelihood(points(inside, Eigen::all));
  for (std::size_t i = 0; i < inside.size(); ++i) result[inside[i]] = values[static_cast<Index>(i)];
  return result;
}

// Largest power of the likelihood, at most one, that leaves so many effective points.
double PowerFor(const Eigen::VectorXd& log_likelihood, const Eigen::VectorXd& log_start,
                double effective) {
  const auto left = [&](double power) {
    Eigen::VectorXd w(log_likelihood.size());
    for (Index i = 0; i < w.size(); ++i) {
      w[i] =
          log_likelihood[i] == -kInfinity ? -kInfinity : power * log_likelihood[i] + log_start[i];
    }
    return EffectiveSampleSize(w);
  };
  if (left(1) >= effective) return 1;
  double low = 0, high = 1;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (left(middle) >= effective ? low : high) = middle;
  }
  return low;
}

CubeProposal ProposalFrom(const Eigen::MatrixXd& points, const Eigen::VectorXd& log_weights,
                          std::uint64_t iteration, const CubeSamplingOptions& options) {
  const Eigen::VectorXd w = NormalizedLogWeights(log_weights);
  const Index d = points.cols();
  const Eigen::VectorXd mean = WeightedMean(w, points);
  // A ridge of a millionth of the cube's side keeps the factor where few points have weight.
  const Eigen::MatrixXd covariance =
      kKernelShare * WeightedCovariance(w, points, mean) + 1e-12 * Eigen::MatrixXd::Identity(d, d);
  PhiloxStream stream({.seed = options.seed,
                       .purpose = StreamPurpose::kDiagnosisEvidence,
                       .iteration = (options.number << 16) + iteration,
                       .sample = ~std::uint64_t{0}});
  // Systematic resampling: evenly spaced through the cumulated weights.
  Eigen::MatrixXd centres(options.centres, d);
  double cumulated = 0, next = stream.Uniform();
  Index c = 0;
  for (Index i = 0; i < points.rows() && c < options.centres; ++i) {
    cumulated += std::exp(w[i]) * options.centres;
    while (c < options.centres && next < cumulated) {
      centres.row(c++) = points.row(i);
      next += 1;
    }
  }
  for (; c < options.centres; ++c) centres.row(c) = mean.transpose();
  centres = (centres.rowwise() - mean.transpose()) * std::sqrt(1 - kKernelShare);
  centres.rowwise() += mean.transpose();
  return {std::move(centres), covariance, options.defence};
}

// A sample, and the logarithms of one over the density that its points were drawn from.
struct CubePoints {
  CubeSample sample;
  Eigen::VectorXd log_start;
};

// The estimate from all points of these proposals, each weighed by the mean of their densities.
CubePoints Together(const std::vector<CubeProposal>& proposals,
                    const std::vector<Eigen::MatrixXd>& points,
                    const std::vector<Eigen::VectorXd>& log_likelihood) {
  const auto count = static_cast<Index>(proposals.size());
  const Index n = points[0].rows();
  CubePoints all;
  CubeSample& result = all.sample;
  result.points.resize(count * n, points[0].cols());
  result.log_likelihood.resize(count * n);
  for (Index t = 0; t < count; ++t) {
    result.points.middleRows(t * n, n) = points[static_cast<std::size_t>(t)];
    result.log_likelihood.segment(t * n, n) = log_likelihood[static_cast<std::size_t>(t)];
  }
  Eigen::MatrixXd densities(count * n, count);
  for (Index t = 0; t < count; ++t)
    densities.col(t) = proposals[static_cast<std::size_t>(t)].LogDensity(result.points);
  all.log_start.resize(count * n);
  for (Index i = 0; i < all.log_start.size(); ++i) {
    all.log_start[i] =
        std::log(static_cast<double>(count)) - LogSumExp(densities.row(i).transpose());
  }
  const Eigen::VectorXd log_weights = result.log_likelihood + all.log_start;
  result.evidence = ImportanceEvidence(log_weights);
  result.tail = ParetoTailIndex(log_weights);
  result.effective = EffectiveSampleSize(log_weights);
  result.best = result.log_likelihood.maxCoeff();
  result.log_weights = NormalizedLogWeights(log_weights);
  return all;
}

}  // namespace

CubeSample SampleCube(const CubeLikelihood& likelihood, Index dimensions,
                      const CubeSamplingOptions& options) {
  const double asked = std::max(50.0, 5.0 * static_cast<double>(dimensions));
  Eigen::MatrixXd points =
      ScrambledSobol(options.start, static_cast<int>(dimensions), options.seed + options.number);
  // A Sobol point may lie on the cube's face.
  points = points.cwiseMax(1e-12).cwiseMin(1 - 1e-12);
  Eigen::VectorXd log_likelihood = InsideCube(likelihood, points);
  Eigen::VectorXd log_start = Eigen::VectorXd::Zero(points.rows());  // ln 1 / proposal
  if (!(log_likelihood.maxCoeff() > -kInfinity)) {
    return {.evidence = {.log_evidence = -kInfinity, .standard_error = kInfinity},
            .best = -kInfinity,
            .points = points,
            .log_likelihood = log_likelihood,
            .log_weights = log_likelihood};
  }
  const auto tempered = [&](double power) {
    Eigen::VectorXd w = log_likelihood;
    for (Index i = 0; i < w.size(); ++i)
      w[i] = w[i] == -kInfinity ? -kInfinity : power * w[i] + log_start[i];
    return w;
  };

  std::uint64_t iteration = 0;
  const auto next = [&](double power) {
    CubeProposal proposal = ProposalFrom(points, tempered(power), iteration, options);
    points = proposal.Draw(options.points, iteration, options);
    log_likelihood = InsideCube(likelihood, points);
    log_start = -proposal.LogDensity(points);
    ++iteration;
    return proposal;
  };
  for (int i = 0; i < options.approaches; ++i) {
    const double power = PowerFor(log_likelihood, log_start, asked);
    if (power == 1) break;
    next(power);
  }
  std::vector<CubeProposal> proposals;
  std::vector<Eigen::MatrixXd> drawn;
  std::vector<Eigen::VectorXd> values;
  for (;;) {
    proposals.push_back(next(PowerFor(log_likelihood, log_start, asked)));
    drawn.push_back(points);
    values.push_back(log_likelihood);
    const auto done = static_cast<int>(proposals.size());
    if (done < options.iterations) continue;
    CubePoints all = Together(proposals, drawn, values);
    if (all.sample.effective >= options.effective || done >= 3 * options.iterations)
      return std::move(all.sample);
    // Too few count: the next proposal follows from all of these.
    points = all.sample.points;
    log_likelihood = all.sample.log_likelihood;
    log_start = all.log_start;
  }
}

}  // namespace calib::inference
