#include "inference/numerics/gaussian_process.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "inference/numerics/bounded_minimizer.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/matern_kernel.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kBlock = 256;  // of points: their cross-covariances stay in the cache
// Standard deviation over the mean below which values differ by rounding; chosen, a few thousand
// machine epsilons.
constexpr double kRounding = 1e-12;
constexpr double kLeastScatter = 1e-8;  // smallest GaussianProcessOptions::max_scatter
constexpr double kMostScatter = 2;      // largest one: a constant's scatter is 1, its estimate more

// Where the search begins, in units of the scaled inputs and outputs; chosen: a smooth function and
// a wiggly one, of which either may be the lower of two minima.
struct Start {
  double length, signal, scatter;
};
constexpr Start kStarts[] = {{4, 1, 1e-3}, {1, 0.3, 1e-2}};

// The box of the search in the same units; chosen: lengths from a fifth of the inputs' standard
// deviation, below which runs say nothing of each other, to where nothing differs from the trend;
// variances from what rounding hides to far beyond the outputs'.
constexpr double kShortest = 0.2;
constexpr double kLongest = 100;
constexpr double kLeastSignal = 1e-8;
constexpr double kMostSignal = 1e3;
constexpr double kLeastNoise = 1e-9;
// Nats of the log posterior density; chosen: hyper-parameters known better than this move no
// prediction by more than they are uncertain.
constexpr MinimizerOptions kSearch{.max_iterations = 40, .tolerance = 1e-2};

// Standard deviation about the mean, and one where there is no spread to scale by.
double Spread(const Eigen::VectorXd& values, double mean) {
  const double sd = std::sqrt((values.array() - mean).square().mean());
  return sd > kRounding * (std::abs(mean) + std::numeric_limits<double>::min()) ? sd : 1;
}

std::vector<Eigen::VectorXd> FixedStarts(Index d, bool grouped) {
  std::vector<Eigen::VectorXd> starts;
  for (const Start& start : kStarts) {
    starts.emplace_back(d + 2) << Eigen::VectorXd::Constant(d, std::log(start.length)),
        std::log(start.signal), std::log(start.scatter);
    if (!grouped) continue;
    starts.back().conservativeResize(d + 3);
    starts.back()[d + 2] = std::log(start.scatter);
  }
  return starts;
}

Minimum MostProbable(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& outputs,
                     const GaussianProcessOptions& options,
                     const std::vector<Eigen::VectorXd>& starts) {
  const Index d = inputs.cols(), variances = options.groups.empty() ? 1 : 2;
  const KernelObjective objective(inputs, outputs, options.groups);
  Eigen::VectorXd lower(d + 1 + variances);
  Eigen::VectorXd upper(d + 1 + variances);
  lower << Eigen::VectorXd::Constant(d, std::log(kShortest)), std::log(kLeastSignal),
      Eigen::VectorXd::Constant(variances, std::log(kLeastNoise));
  upper << Eigen::VectorXd::Constant(d, std::log(kLongest)), std::log(kMostSignal),
      Eigen::VectorXd::Constant(variances, std::log(options.max_scatter));
  Minimum best{.x = {}, .value = std::numeric_limits<double>::infinity()};
  for (const Eigen::VectorXd& start : starts) {
    const Eigen::VectorXd x = start.cwiseMax(lower).cwiseMin(upper);
    Eigen::VectorXd gradient(x.size());
    if (!std::isfinite(objective(x, gradient))) continue;
    const Minimum minimum = MinimizeInBox(objective, x, lower, upper, kSearch);
    if (minimum.value < best.value) best = minimum;
  }
  return best;
}

}  // namespace

absl::StatusOr<GaussianProcess> GaussianProcess::Fit(const Eigen::MatrixXd& inputs,
                                                     const Eigen::VectorXd& outputs,
                                                     const GaussianProcessOptions& options) {
  assert(inputs.rows() == outputs.size() && inputs.rows() >= 4);
  assert(options.max_scatter >= kLeastScatter && options.max_scatter <= kMostScatter);
  assert(options.like == nullptr || !options.like->constant());
  assert(options.groups.empty() || (!options.may_be_constant && options.like == nullptr &&
                                    static_cast<Index>(options.groups.size()) == inputs.rows()));
  const Index n = inputs.rows();
  const Index d = inputs.cols();
  GaussianProcess process;
  process.input_mean_ = inputs.colwise().mean();
  process.input_sd_.resize(d);
  for (Index j = 0; j < d; ++j)
    process.input_sd_[j] = Spread(inputs.col(j), process.input_mean_[j]);
  process.output_mean_ = outputs.mean();
  process.output_sd_ = Spread(outputs, process.output_mean_);
  process.used_.resize(static_cast<std::size_t>(d));
  std::iota(process.used_.begin(), process.used_.end(), Index{0});
  const Eigen::MatrixXd all = process.Scaled(inputs);
  const Eigen::VectorXd scaled = (outputs.array() - process.output_mean_) / process.output_sd_;

  std::vector<Eigen::VectorXd> starts = FixedStarts(d, !options.groups.empty());
  if (options.like != nullptr) {
    process.used_ = options.like->used_;
    starts = {options.like->HyperParameters()};
  }
  Minimum hyper = MostProbable(all(Eigen::all, process.used_), scaled, options, starts);
  if (!std::isfinite(hyper.value)) {
    return absl::FailedPreconditionError(
        "the emulator's covariance matrix cannot be factorised: are the runs' parameters all the "
        "same?");
  }
  // Against the density of the best constant, whose scatter has the outputs' variance, one;
  // Gaussian normalisers and the prior of the scatter, which both have, left out.
  const auto count = static_cast<double>(n);
  const double of_constant = 0.5 * count + 0.5 * std::log1p(count * kTrendVariance);
  if (options.may_be_constant && hyper.value > of_constant) {
    // A vague slope along every input costs more than one weak input can repay: inputs one by one.
    hyper.value = of_constant;
    process.used_.clear();
    for (bool better = true; better;) {
      better = false;
      const std::vector<Index> kept = process.used_;
      for (Index j = 0; j < d; ++j) {
        if (std::find(kept.begin(), kept.end(), j) != kept.end()) continue;
        std::vector<Index> used = kept;
        used.push_back(j);
        const Minimum tried = MostProbable(all(Eigen::all, used), scaled, options,
                                           FixedStarts(static_cast<Index>(used.size()), false));
        if (!(tried.value < hyper.value)) continue;
        hyper = tried;
        process.used_ = std::move(used);
        better = true;
      }
    }
    if (process.used_.empty()) {
      process.SetConstant(outputs);
      return process;
    }
  }
  const auto of = static_cast<Index>(process.used_.size());
  process.train_ = all(Eigen::all, process.used_);
  process.lengths_ = hyper.x.head(of).array().exp().transpose();
  process.signal_ = std::exp(hyper.x[of]);
  const double scatter = std::exp(hyper.x[of + 1]);
  const double output_variance = process.output_sd_ * process.output_sd_;
  process.scatter_variance_ = scatter * output_variance;

  Eigen::MatrixXd covariance = KernelMatrix(
      process.train_, process.train_, {.lengths = process.lengths_, .signal = process.signal_});
  covariance.diagonal().array() += scatter;
  if (!options.groups.empty()) {
    const double group = std::exp(hyper.x[of + 2]);
    process.group_variance_ = group * output_variance;
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) {
        if (options.groups[static_cast<std::size_t>(i)] ==
            options.groups[static_cast<std::size_t>(j)])
          covariance(i, j) += group;
      }
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  process.cholesky_ = factor.matrixL();
  process.alpha_ = factor.solve(scaled);
  const Eigen::VectorXd precision = Solved(factor, Eigen::MatrixXd::Identity(n, n)).diagonal();
  process.leave_one_out_.error = process.output_sd_ * process.alpha_.cwiseQuotient(precision);
  process.leave_one_out_.variance = output_variance * precision.cwiseInverse();
  return process;
}

Eigen::VectorXd GaussianProcess::lengths() const {
  Eigen::VectorXd lengths =
      Eigen::VectorXd::Constant(input_sd_.size(), std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < used_.size(); ++k)
    lengths[used_[k]] = lengths_[static_cast<Index>(k)] * input_sd_[used_[k]];
  return lengths;
}

Eigen::VectorXd GaussianProcess::HyperParameters() const {
  Eigen::VectorXd x(lengths_.size() + 2);
  x << lengths_.transpose().array().log().matrix(), std::log(signal_),
      std::log(scatter_variance_ / (output_sd_ * output_sd_));
  return x;
}

void GaussianProcess::SetConstant(const Eigen::VectorXd& outputs) {
  const auto n = static_cast<double>(outputs.size());
  constant_ = true;
  const Eigen::ArrayXd deviation = outputs.array() - output_mean_;
  scatter_variance_ = deviation.square().sum() / (n - 1);
  leave_one_out_.error = deviation * (n / (n - 1));
  leave_one_out_.variance =
      Eigen::VectorXd::Constant(outputs.size(), scatter_variance_ * (1 + 1 / (n - 1)));
  constant_variance_ = scatter_variance_ / n;
}

GaussianProcessPrediction GaussianProcess::Predict(const Eigen::MatrixXd& inputs) const {
  const Index m = inputs.rows();
  GaussianProcessPrediction prediction{
      .mean = Eigen::VectorXd::Constant(m, output_mean_),
      .variance = Eigen::VectorXd::Constant(m, constant_variance_)};
  if (constant_) return prediction;
  for (Index first = 0; first < m; first += kBlock) {
    const Index size = std::min(kBlock, m - first);
    const GaussianProcessPrediction block = PredictBlock(inputs.middleRows(first, size));
    prediction.mean.segment(first, size) = block.mean;
    prediction.variance.segment(first, size) = block.variance;
  }
  return prediction;
}

Eigen::VectorXd GaussianProcess::PredictMean(const Eigen::MatrixXd& inputs) const {
  const Index m = inputs.rows();
  Eigen::VectorXd mean = Eigen::VectorXd::Constant(m, output_mean_);
  for (Index first = 0; !constant_ && first < m; first += kBlock) {
    const Index size = std::min(kBlock, m - first);
    mean.segment(first, size) = MeanFrom(CrossCovariances(Used(inputs.middleRows(first, size))));
  }
  return mean;
}

Eigen::MatrixXd GaussianProcess::Covariance(const Eigen::MatrixXd& a,
                                            const Eigen::MatrixXd& b) const {
  if (constant_) return Eigen::MatrixXd::Constant(a.rows(), b.rows(), constant_variance_);
  const Eigen::MatrixXd at_a = Used(a), at_b = Used(b);
  Eigen::MatrixXd cross_a = CrossCovariances(at_a), cross_b = CrossCovariances(at_b);
  cholesky_.triangularView<Eigen::Lower>().solveInPlace(cross_a);
  cholesky_.triangularView<Eigen::Lower>().solveInPlace(cross_b);
  return output_sd_ * output_sd_ *
         (KernelMatrix(at_a, at_b, {.lengths = lengths_, .signal = signal_}) -
          cross_a.transpose() * cross_b);
}

Eigen::MatrixXd GaussianProcess::Scaled(const Eigen::MatrixXd& inputs) const {
  return (inputs.rowwise() - input_mean_).array().rowwise() / input_sd_.array();
}

Eigen::MatrixXd GaussianProcess::Used(const Eigen::MatrixXd& inputs) const {
  return Scaled(inputs)(Eigen::all, used_);
}

Eigen::MatrixXd GaussianProcess::CrossCovariances(const Eigen::MatrixXd& points) const {
  return KernelMatrix(train_, points, {.lengths = lengths_, .signal = signal_});
}

Eigen::VectorXd GaussianProcess::MeanFrom(const Eigen::MatrixXd& cross) const {
  return (cross.transpose() * alpha_ * output_sd_).array() + output_mean_;
}

GaussianProcessPrediction GaussianProcess::PredictBlock(const Eigen::MatrixXd& inputs) const {
  const Eigen::MatrixXd points = Used(inputs);
  Eigen::MatrixXd cross = CrossCovariances(points);
  GaussianProcessPrediction prediction;
  prediction.mean = MeanFrom(cross);
  cholesky_.triangularView<Eigen::Lower>().solveInPlace(cross);
  prediction.variance = kTrendVariance * (1 + points.rowwise().squaredNorm().array()) + signal_;
  prediction.variance -= cross.colwise().squaredNorm().transpose();
  // Cancellation leaves at most a few hundred epsilon of the prior variance.
  prediction.variance = output_sd_ * output_sd_ * prediction.variance.cwiseMax(0);
  return prediction;
}

}  // namespace calib::inference
